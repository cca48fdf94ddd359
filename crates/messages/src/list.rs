//! A list of bounded length inside a layout.
//!
//! In memory it is a count and room for the greatest number of elements. Over ROS 2 and in files it is a sequence of
//! the elements in use.

use std::ops::Deref;

use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A list of up to `MOST` elements. The list dereferences to the slice of the elements in use.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::List;
///
/// let list: List<u32, 4> = List::of([3, 1, 2]);
/// assert_eq!((list.len(), list[2]), (3, 2));
/// // Elements beyond the room are left out.
/// assert_eq!(List::<u32, 2>::of([3, 1, 2])[..], [3, 1]);
/// ```
#[derive(Debug, Clone, Copy, ZeroCopySend)]
#[repr(C)]
pub struct List<T: ZeroCopySend, const MOST: usize> {
    /// The elements in use.
    length: u32,
    /// Always 0.
    reserved: u32,
    /// The elements; those not in use are zero.
    items: [T; MOST],
}

impl<T: ZeroCopySend + Copy + Default, const MOST: usize> List<T, MOST> {
    /// Creates a list of the first `MOST` elements.
    pub fn of(elements: impl IntoIterator<Item = T>) -> Self {
        let (mut length, mut items) = (0, [T::default(); MOST]);
        for (slot, element) in items.iter_mut().zip(elements) {
            *slot = element;
            length += 1;
        }
        Self { length, reserved: 0, items }
    }
}

impl<T: ZeroCopySend + Copy + Default, const MOST: usize> Default for List<T, MOST> {
    fn default() -> Self {
        Self::of([])
    }
}

impl<T: ZeroCopySend, const MOST: usize> Deref for List<T, MOST> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        // Another process wrote the length.
        &self.items[..(self.length as usize).min(MOST)]
    }
}

impl<T: ZeroCopySend + PartialEq, const MOST: usize> PartialEq for List<T, MOST> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<T: ZeroCopySend + Serialize, const MOST: usize> Serialize for List<T, MOST> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (**self).serialize(serializer)
    }
}

impl<'de, T: ZeroCopySend + Copy + Default + Deserialize<'de>, const MOST: usize> Deserialize<'de> for List<T, MOST> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let elements = Vec::<T>::deserialize(deserializer)?;
        if elements.len() > MOST {
            return Err(D::Error::custom(format_args!("{} elements, expected at most {MOST}", elements.len())));
        }
        Ok(Self::of(elements))
    }
}
