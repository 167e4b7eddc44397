//! Names in messages are text, whatever is in them, and no command to a terminal.

use std::io;
use std::path::PathBuf;

use surefix::Error;

/// A name, and how it is shown.
const NAMES: [(&str, &str); 7] = [
    ("a\u{1b}]0;owned\u{7}.png", "a\\x1b]0;owned\\x07.png"),
    ("\u{1b}[2J\u{1b}[1;31mroute", "\\x1b[2J\\x1b[1;31mroute"),
    ("b\u{9b}31m\u{7f}", "b\\x9b31m\\x7f"),
    ("two\nlines\r\tof\u{85}it", "two\\nlines\\r\\tof\\x85it"),
    ("gnp.\u{202e}c\u{2066}\u{2069}", "gnp.\\u202ec\\u2066\\u2069"),
    ("\u{2028}\u{2029}\0", "\\u2028\\u2029\\x00"),
    ("Straße 東京 👩‍👩‍👧 100 % \\ \"'", "Straße 東京 👩‍👩‍👧 100 % \\ \"'"),
];

/// Each error that holds a word from outside.
fn errors(word: &str) -> Vec<Error> {
    let (word, path) = (word.to_owned(), PathBuf::from(word));
    let pair = (word.clone(), word.clone());
    vec![
        Error::Option { name: "motion", expected: "free".to_owned(), got: word.clone() },
        Error::Image { name: pair.0, reason: pair.1 },
        Error::ImageSize { name: word.clone(), expected: (4, 2), got: (2, 4) },
        Error::NoImages { place: word.clone(), left_out: word.clone() },
        Error::Io { path: path.clone(), action: "read", source: io::Error::other(word.clone()) },
        Error::MapFile { path: path.clone(), reason: word.clone() },
        Error::MapVersion { path, found: 9, supported: 1 },
        Error::Append { map: word.clone(), expected: word.clone(), got: word.clone() },
        Error::Snapshot { reason: word.clone() },
        Error::Settings { reason: word },
    ]
}

#[test]
fn no_word_is_a_command() {
    for (word, shown) in NAMES {
        for (error, plain) in errors(word).iter().zip(errors("name")) {
            // The message of the same error with a harmless word, with this one in its place.
            assert_eq!(error.to_string(), plain.to_string().replace("name", shown));
            assert_eq!(format!("{error:?}"), error.to_string());
        }
    }
}

#[cfg(unix)]
#[test]
fn files_that_are_not_there_are_named_in_plain_text() {
    use std::os::unix::ffi::OsStrExt;

    for (word, shown) in NAMES {
        // No path holds a zero byte.
        if word.contains('\0') {
            continue;
        }
        let path = std::path::Path::new("/nowhere").join(word);
        let refused = surefix::Map::open(&path).err().map(|error| error.to_string());
        let expected = format!("/nowhere/{shown}: cannot ");
        assert!(refused.as_ref().is_some_and(|said| said.starts_with(&expected)), "{refused:?}");
    }
    let path = std::path::Path::new(std::ffi::OsStr::from_bytes(b"/nowhere/\xff\x1b"));
    let refused = surefix::Map::open(path).err().map(|error| error.to_string());
    assert!(refused.is_some_and(|said| said.starts_with("/nowhere/\u{fffd}\\x1b: cannot ")));
}

#[cfg(feature = "toml")]
#[test]
fn a_line_of_settings_is_not_repeated() {
    let refused = surefix::Settings::from_toml("[config]\n\u{1b}]0;owned\u{7} = 1").err();
    let said = refused.map(|error| error.to_string()).unwrap_or_default();
    assert!(said.starts_with("settings: line 2: ") && !said.contains(char::is_control), "{said}");
}
