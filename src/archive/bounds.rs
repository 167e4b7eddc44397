//! The bounds of a header, looked at before anything of it is kept.

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

use serde::de::{Deserialize, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// The most tensors of an archive. A map has about a dozen, a snapshot one for each technique and
/// each statistic as well.
pub(super) const MAX_TENSORS: usize = 1024;
/// The most entries of its metadata: surefix has one.
const MAX_ENTRIES: usize = 64;
/// The most axes of a tensor: thumbnails have three.
const MAX_AXES: usize = 8;

/// A header that is within the bounds.
pub(super) struct Bounded;

/// The contents of a tensor's description that can be long.
#[derive(serde::Deserialize)]
struct Info {
    #[serde(rename = "shape")]
    _shape: Count<IgnoredAny>,
}

/// A list, or the values of an object, counted and thrown away.
struct Count<T>(PhantomData<T>);

impl<'de> Deserialize<'de> for Bounded {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_map(Tensors)
    }
}

struct Tensors;

impl<'de> Visitor<'de> for Tensors {
    type Value = Bounded;

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("an object of tensors")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Bounded, A::Error> {
        let mut count = 0;
        while let Some(name) = map.next_key::<Cow<'de, str>>()? {
            if name == "__metadata__" {
                map.next_value::<Count<IgnoredAny>>()?;
                continue;
            }
            count += 1;
            if count > MAX_TENSORS {
                return Err(Error::custom(format!("expected at most {MAX_TENSORS} tensors")));
            }
            map.next_value::<Info>()?;
        }
        Ok(Bounded)
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Count<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(Self(PhantomData))
    }
}

impl<'de, T: Deserialize<'de>> Visitor<'de> for Count<T> {
    type Value = Self;

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("a shape, or metadata")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self, A::Error> {
        let mut count = 0;
        while list.next_element::<T>()?.is_some() {
            count += 1;
            if count > MAX_AXES {
                return Err(Error::custom(format!("expected a tensor of at most {MAX_AXES} axes")));
            }
        }
        Ok(self)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self, A::Error> {
        let mut count = 0;
        while map.next_entry::<IgnoredAny, T>()?.is_some() {
            count += 1;
            if count > MAX_ENTRIES {
                let expected = format!("expected at most {MAX_ENTRIES} entries of metadata");
                return Err(Error::custom(expected));
            }
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(header: &str) -> Option<String> {
        serde_json::from_str::<Bounded>(header).err().map(|error| error.to_string())
    }

    #[test]
    fn a_header_is_within_its_bounds_or_refused() {
        let tensor =
            |shape: &str| format!(r#"{{"dtype":"U8","shape":{shape},"data_offsets":[0,0]}}"#);
        let tensors = |count: usize| {
            let each: Vec<_> = (0..count).map(|i| format!(r#""{i}":{}"#, tensor("[0]"))).collect();
            format!("{{{}}}", each.join(","))
        };
        let axes =
            |count: usize| format!(r#"{{"a":{}}}"#, tensor(&format!("{:?}", vec![1; count])));
        let entries = |count: usize| {
            let each: Vec<_> = (0..count).map(|i| format!(r#""{i}":"""#)).collect();
            format!(r#"{{"__metadata__":{{{}}}}}"#, each.join(","))
        };
        assert_eq!(refusal(&tensors(MAX_TENSORS)), None);
        assert_eq!(refusal(&axes(MAX_AXES)), None);
        assert_eq!(refusal(&entries(MAX_ENTRIES)), None);
        for (header, expected) in [
            (tensors(MAX_TENSORS + 1), "at most 1024 tensors"),
            (axes(MAX_AXES + 1), "at most 8 axes"),
            (entries(MAX_ENTRIES + 1), "at most 64 entries"),
            ("[]".to_owned(), "an object of tensors"),
        ] {
            let got = refusal(&header).unwrap();
            assert!(got.contains(expected), "{got}");
        }
    }
}
