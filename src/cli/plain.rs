//! What libraries say of errors, in the words of this program. Errors of the system, of readers of JSON and of
//! pictures and of the argument parser are passed on by many commands; here they are put in plain words once,
//! where a line is printed.

/// What libraries say, and what a user reads in its place.
const WORDS: [(&str, &str); 29] = [
    // The system.
    ("No such file or directory", "there is no such file"),
    ("Is a directory", "it is a folder"),
    ("is a directory", "it is a folder"),
    ("Not a directory", "part of its path is a file"),
    ("Permission denied", "that is not allowed"),
    ("File name too long", "its name is too long"),
    ("stream did not contain valid UTF-8", "it is no text"),
    ("failed to fill whole buffer", "it is cut off"),
    // JSON.
    (
        "EOF while parsing a value at line 1 column 0",
        "it is empty",
    ),
    ("EOF while parsing a value at", "it is cut off at"),
    ("EOF while parsing a list at", "it is cut off at"),
    ("EOF while parsing a string at", "it is cut off at"),
    ("EOF while parsing an object at", "it is cut off at"),
    ("expected value at", "it is no JSON at"),
    ("expected ident at", "it is no JSON at"),
    ("key must be a string at", "it is no JSON at"),
    ("trailing characters at", "there is more after its end at"),
    ("trailing comma at", "a comma is too many at"),
    ("invalid type: ", "a value of the wrong kind: "),
    ("expected u32", "expected u32 (a whole number)"),
    ("expected f64", "expected f64 (a number)"),
    // Pictures, sounds and drawings.
    ("unexpected end of file", "it is cut off"),
    (
        "The image format could not be determined",
        "of no known format",
    ),
    ("Ill-formed WAVE file: ", ""),
    ("Failed to read enough bytes.", "it is cut off"),
    (
        "the document does not have a root node",
        "it is cut off, or no SVG",
    ),
    // The argument parser.
    ("invalid digit found in string", "give a whole number"),
    (
        "number too large to fit in target type",
        "that is too large",
    ),
    ("invalid float literal", "give a number"),
];

/// Largest number of a range that stands for no limit.
const NO_LIMIT: &str = "18446744073709551615";

/// The line in plain words.
pub fn plain(line: &str) -> String {
    let mut plain = without_os_errors(line);
    for (words, own) in WORDS {
        if plain.contains(words) {
            plain = plain.replace(words, own);
        }
    }
    let plain = picture_in_words(&plain).unwrap_or(plain);
    range_in_words(&plain).unwrap_or(plain)
}

/// What is said of a file whose name is that of no picture; `None` where the line says nothing of the kind.
fn picture_in_words(line: &str) -> Option<String> {
    let (before, rest) = line.split_once("The file extension `")?;
    let (_, after) = rest.split_once("` was not recognized as an image format")?;
    Some(format!("{before}its name is not that of a picture{after}"))
}

/// Without the numbers of the system's errors: ` (os error 2)`.
fn without_os_errors(line: &str) -> String {
    const BEGIN: &str = " (os error ";
    let mut parts = line.split(BEGIN);
    let mut plain = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        match part.split_once(')') {
            Some((number, rest)) if number.parse::<i32>().is_ok() => plain.push_str(rest),
            _ => {
                plain.push_str(BEGIN);
                plain.push_str(part);
            }
        }
    }
    plain
}

/// `0 is not in 1..=64` as `give a number from 1 to 64`; `None` where the line says nothing of the kind.
fn range_in_words(line: &str) -> Option<String> {
    const WORDS: &str = " is not in ";
    let (before, range) = line.rsplit_once(WORDS)?;
    let (head, number) = before.rsplit_once(' ')?;
    let (low, high) = range.trim_end().split_once("..")?;
    let high = high.trim_start_matches('=');
    let numbers = [number, low, high];
    if !numbers.iter().all(|number| number.parse::<i128>().is_ok()) {
        return None;
    }
    Some(match high {
        NO_LIMIT => format!("{head} give a number from {low} on"),
        _ => format!("{head} give a number from {low} to {high}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_libraries_say_is_put_in_plain_words() {
        for (line, expected) in [
            (
                "cannot read a.json: No such file or directory (os error 2); give another",
                "cannot read a.json: there is no such file; give another",
            ),
            (
                "EOF while parsing a value at line 3 column 26; it must hold width",
                "it is cut off at line 3 column 26; it must hold width",
            ),
            (
                "invalid value '0' for '--count <N>': 0 is not in 1..=64",
                "invalid value '0' for '--count <N>': give a number from 1 to 64",
            ),
            (
                "invalid value '0' for '--tree <N>': 0 is not in 1..18446744073709551615",
                "invalid value '0' for '--tree <N>': give a number from 1 on",
            ),
            (
                "cannot read a.json: The file extension `.\"json\"` was not recognized as an image format; give a PNG",
                "cannot read a.json: its name is not that of a picture; give a PNG",
            ),
            (
                "the file (os error x) is not in b..c",
                "the file (os error x) is not in b..c",
            ),
        ] {
            assert_eq!(plain(line), expected);
        }
    }
}
