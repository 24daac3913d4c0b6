//! Text of files that other programs have written.

/// What some of them write before the text.
const BYTE_ORDER_MARK: char = '\u{feff}';

/// The text without a byte order mark before it.
pub fn without_byte_order_mark(text: &str) -> &str {
    text.trim_start_matches(BYTE_ORDER_MARK)
}
