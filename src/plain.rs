//! Names in messages are text, whatever is in them, and no command to a terminal.

use std::fmt::{self, Display, Write};

/// Shows control characters, the ends of lines and the directions of Unicode escaped, as `\x1b`; so
/// does `plain` in `python/surefix/_words.py`.
pub(crate) struct Plain<T>(pub(crate) T);

impl<T: Display> Display for Plain<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(Escaping(f), "{}", self.0)
    }
}

struct Escaping<'a, 'b>(&'a mut fmt::Formatter<'b>);

impl Write for Escaping<'_, '_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.chars().try_for_each(|letter| match letter {
            '\t' => self.0.write_str("\\t"),
            '\n' => self.0.write_str("\\n"),
            '\r' => self.0.write_str("\\r"),
            '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => {
                write!(self.0, "\\u{:04x}", u32::from(letter))
            }
            _ if letter.is_control() => write!(self.0, "\\x{:02x}", u32::from(letter)),
            _ => self.0.write_char(letter),
        })
    }
}
