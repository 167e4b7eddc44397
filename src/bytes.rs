//! Lists of numbers as bytes, little-endian, in serde: shorter than number by number.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{Error, Visitor};
use serde::{Deserializer, Serializer};

use crate::archive::swap_to_file_order;

/// Writes the numbers.
pub(crate) fn serialize<T: bytemuck::NoUninit, S: Serializer>(
    numbers: &[T],
    to: S,
) -> Result<S::Ok, S::Error> {
    let bytes: &[u8] = bytemuck::must_cast_slice(numbers);
    if cfg!(target_endian = "little") {
        return to.serialize_bytes(bytes);
    }
    let mut bytes = bytes.to_vec();
    swap_to_file_order(&mut bytes, size_of::<T>());
    to.serialize_bytes(&bytes)
}

/// Reads them.
pub(crate) fn deserialize<
    'de,
    T: bytemuck::AnyBitPattern + bytemuck::NoUninit,
    D: Deserializer<'de>,
>(
    from: D,
) -> Result<Vec<T>, D::Error> {
    struct Numbers<T>(PhantomData<T>);
    impl<T: bytemuck::AnyBitPattern + bytemuck::NoUninit> Visitor<'_> for Numbers<T> {
        type Value = Vec<T>;

        fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(to, "the bytes of numbers of {} bytes", size_of::<T>())
        }

        fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Vec<T>, E> {
            if !bytes.len().is_multiple_of(size_of::<T>()) {
                return Err(E::invalid_length(bytes.len(), &self));
            }
            let mut numbers = vec![T::zeroed(); bytes.len() / size_of::<T>()];
            let own: &mut [u8] = bytemuck::must_cast_slice_mut(&mut numbers);
            own.copy_from_slice(bytes);
            swap_to_file_order(own, size_of::<T>());
            Ok(numbers)
        }
    }
    from.deserialize_bytes(Numbers(PhantomData))
}
