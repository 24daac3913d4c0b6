//! Numbers and texts cut to the room there is.

use crate::model::Interval;
use ratatui::text::Line;

/// A count in at most five characters: `99999`, `1234k`, `56M`.
pub fn count(n: u64) -> String {
    match n {
        0..=99_999 => n.to_string(),
        100_000..=9_999_999 => format!("{}k", n / 1_000),
        10_000_000..=9_999_999_999 => format!("{}M", n / 1_000_000),
        10_000_000_000..=9_999_999_999_999 => format!("{}G", n / 1_000_000_000),
        _ => "lots".to_owned(),
    }
}

/// A measured value in at most seven characters, with two decimals where they fit; a dash for what
/// is no number.
pub fn value(x: f64) -> String {
    match x.abs() {
        a if !a.is_finite() => "–".to_owned(),
        a if a >= 999_999.5 => format!("{x:.0e}"),
        a if a >= 999.95 => format!("{x:.0}"),
        a if a >= 99.995 => format!("{x:.1}"),
        _ => format!("{x:.2}"),
    }
}

/// A value and half of its interval, with as many decimals as that bears, in at most thirteen
/// characters where the value is less than 100. The half is rounded up: nothing looks surer than it
/// is.
pub fn plus_minus(i: &Interval) -> String {
    let half = 0.5 * (i.hi - i.lo);
    if !(i.value.is_finite() && half.is_finite()) || i.value.abs() >= 99.995 || half >= 99.0 {
        return value(i.value);
    }
    let decimals = match half {
        h if h >= 0.05 => 2,
        h if h >= 0.005 || i.value >= 9.9995 => 3,
        _ => 4,
    };
    let unit = 10f64.powi(-decimals);
    let half = ((half / unit - 1e-6).ceil() * unit).max(unit);
    format!(
        "{:.*}±{half:.*}",
        decimals as usize, i.value, decimals as usize
    )
}

/// Milliseconds, with a decimal only where it counts.
pub fn millis(ms: f64) -> String {
    if ms.abs() < 9_999.5 && (ms.abs() >= 9.95) {
        format!("{ms:.0} ms")
    } else {
        format!("{} ms", short(ms))
    }
}

fn short(x: f64) -> String {
    if x.abs() < 9.95 {
        format!("{x:.1}")
    } else {
        value(x)
    }
}

/// Seconds as `m:ss` or `h:mm:ss`.
pub fn clock(time_s: f64) -> String {
    if !time_s.is_finite() || time_s < 0.0 {
        return "–".to_owned();
    }
    // Beyond a thousand hours the figure says nothing; the cap keeps it short.
    let s = time_s.min(3_599_999.0) as u64;
    if s >= 3600 {
        format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60)
    } else {
        format!("{}:{:02}", s / 60, s % 60)
    }
}

/// Columns that the text takes on the screen.
pub fn width(text: &str) -> usize {
    Line::raw(text).width()
}

/// The end of a text that is too long, because the end of a path tells more than its beginning.
pub fn keep_end(text: &str, room: usize) -> String {
    if width(text) <= room {
        return text.to_owned();
    }
    let mut kept = String::new();
    for c in text.chars().rev() {
        let longer = format!("{c}{kept}");
        if width(&longer) + 1 > room {
            break;
        }
        kept = longer;
    }
    if room == 0 {
        String::new()
    } else {
        format!("…{kept}")
    }
}

/// The beginning of a text that is too long.
pub fn keep_begin(text: &str, room: usize) -> String {
    if width(text) <= room {
        return text.to_owned();
    }
    let mut kept = String::new();
    for c in text.chars() {
        if width(&kept) + width(c.encode_utf8(&mut [0; 4])) + 1 > room {
            break;
        }
        kept.push(c);
    }
    if room > 0 {
        kept.push('…');
    }
    kept
}

/// Breaks a text at spaces into lines of at most `room` columns; a word longer than that is broken
/// where it must.
pub fn wrap(text: &str, room: usize) -> Vec<String> {
    let mut lines = Vec::new();
    if room == 0 {
        return lines;
    }
    for paragraph in text.lines() {
        let mut line = String::new();
        for word in paragraph.split_whitespace() {
            let gap = if line.is_empty() { "" } else { " " };
            if width(&line) + gap.len() + width(word) <= room {
                line = line + gap + word;
                continue;
            }
            if !line.is_empty() {
                lines.push(std::mem::take(&mut line));
            }
            for c in word.chars() {
                if !line.is_empty() && width(&line) + width(c.encode_utf8(&mut [0; 4])) > room {
                    lines.push(std::mem::take(&mut line));
                }
                line.push(c);
            }
        }
        if !line.is_empty() {
            lines.push(line);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers() {
        for (n, text) in [
            (0, "0"),
            (99_999, "99999"),
            (123_456, "123k"),
            (45_000_000, "45M"),
            (u64::MAX, "lots"),
        ] {
            assert_eq!(count(n), text);
        }
        for (x, text) in [
            (0.0, "0.00"),
            (9.999, "10.00"),
            (29.97, "29.97"),
            (99.996, "100.0"),
            (123456.7, "123457"),
            (-2.345, "-2.35"),
            (f64::NAN, "–"),
            (f64::INFINITY, "–"),
            (1e300, "1e300"),
        ] {
            assert_eq!(value(x), text);
        }
        for (ms, text) in [
            (0.04, "0.0 ms"),
            (21.4, "21 ms"),
            (1e9, "1e9 ms"),
            (f64::NAN, "– ms"),
        ] {
            assert_eq!(millis(ms), text);
        }
        for (s, text) in [
            (0.0, "0:00"),
            (61.9, "1:01"),
            (3661.0, "1:01:01"),
            (f64::NAN, "–"),
            (1e300, "999:59:59"),
        ] {
            assert_eq!(clock(s), text);
        }
    }

    #[test]
    fn intervals() {
        for (value, lo, hi, text) in [
            (0.701_23, 0.700_8, 0.701_6, "0.7012±0.0004"),
            (0.701_23, 0.698, 0.704, "0.7012±0.0030"),
            (0.7, 0.7, 0.7, "0.7000±0.0001"),
            (0.041, 0.03, 0.055, "0.041±0.013"),
            (1.25, 1.15, 1.36, "1.25±0.11"),
            (12.345, 12.3, 12.31, "12.345±0.005"),
            (f64::NAN, 0.0, 1.0, "–"),
            (1.0, 0.0, f64::INFINITY, "1.00"),
        ] {
            assert_eq!(plus_minus(&Interval { value, lo, hi }), text);
        }
    }

    #[test]
    fn texts() {
        for (text, room, lines) in [
            ("", 10, vec![]),
            ("one two", 10, vec!["one two"]),
            ("one two three", 8, vec!["one two", "three"]),
            ("abcdefghij", 4, vec!["abcd", "efgh", "ij"]),
            ("a\nb", 4, vec!["a", "b"]),
            ("anything", 0, vec![]),
            ("木木木", 4, vec!["木木", "木"]),
            ("木", 1, vec!["木"]),
        ] {
            assert_eq!(wrap(text, room), lines, "{text:?} in {room}");
        }
        for (text, room, kept) in [
            ("/a/b.mcap", 20, "/a/b.mcap"),
            ("/a/b.mcap", 6, "….mcap"),
            ("abc", 0, ""),
        ] {
            assert_eq!(keep_end(text, room), kept);
        }
        for (text, room, kept) in [
            ("one two", 7, "one two"),
            ("one two", 6, "one t…"),
            ("木木木", 4, "木…"),
            ("one", 1, "…"),
            ("one", 0, ""),
        ] {
            assert_eq!(keep_begin(text, room), kept);
        }
    }
}
