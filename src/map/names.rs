//! The places' names, as one text until somebody asks for them.

use std::sync::OnceLock;

use crate::error::Error;

/// A name for each place: the form of the file, a NUL after each. A million strings of their own
/// would take longer to make than all the rest of a map takes to open.
#[derive(Clone, Debug)]
pub(super) struct Names {
    text: String,
    count: usize,
    list: OnceLock<Vec<String>>,
}

impl Names {
    /// # Errors
    /// [`Error::Option`] for a name with a NUL.
    pub(super) fn new<S: AsRef<str>>(names: impl IntoIterator<Item = S>) -> Result<Self, Error> {
        let mut text = String::new();
        let mut count = 0;
        for name in names {
            let name = name.as_ref();
            if name.contains('\0') {
                let expected = "names without NUL characters".to_owned();
                return Err(Error::Option { name: "names", expected, got: format!("{name:?}") });
            }
            text.push_str(name);
            text.push('\0');
            count += 1;
        }
        Ok(Self { text, count, list: OnceLock::new() })
    }

    /// The names that a file holds; nothing where it is no text.
    pub(super) fn from_bytes(bytes: Vec<u8>) -> Option<Self> {
        let mut text = String::from_utf8(bytes).ok()?;
        if !text.is_empty() && !text.ends_with('\0') {
            text.push('\0');
        }
        let count = text.bytes().filter(|&byte| byte == 0).count();
        Some(Self { text, count, list: OnceLock::new() })
    }

    /// These, and then those.
    pub(super) fn followed_by(&self, more: &Self) -> Self {
        let text = [self.text.as_str(), &more.text].concat();
        Self { text, count: self.count + more.count, list: OnceLock::new() }
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// As they stand in a file.
    pub(super) fn bytes(&self) -> &[u8] {
        self.text.as_bytes()
    }

    /// One by one.
    pub(super) fn list(&self) -> &[String] {
        self.list.get_or_init(|| self.text.split_terminator('\0').map(str::to_owned).collect())
    }
}
