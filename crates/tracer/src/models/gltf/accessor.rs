//! Accessors (§3.6.2): numbers in the bytes of a view, whole or sparse, normalised or not. Every element is looked up where
//! it lies; nothing is copied because a file claims a count.

use std::collections::HashMap;

use gltf::json::accessor::{ComponentType, Type, sparse};
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Accessor, Index};

use super::buffers::range;
use super::{Document, ModelError};

/// The elements of an accessor, each within bytes that are there.
pub(super) struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    count: usize,
    component: ComponentType,
    normalised: bool,
    /// What stands in the place of some elements (§3.6.2.3).
    sparse: HashMap<usize, &'a [u8]>,
}

impl<'a> Elements<'a> {
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// How many elements were looked at to get here.
    pub(super) fn cost(&self) -> usize {
        self.sparse.len()
    }

    fn element(&self, index: usize) -> Option<&'a [u8]> {
        if index >= self.count {
            return None;
        }
        match self.sparse.get(&index) {
            Some(bytes) => Some(bytes),
            None => self.bytes.get(index * self.stride..index * self.stride + self.size),
        }
    }

    /// The numbers of one element; integers are decoded as §3.6.2.2 says, or taken as they are (`KHR_mesh_quantization`).
    pub(super) fn numbers<const N: usize>(&self, index: usize) -> Option<[f32; N]> {
        let bytes = self.element(index)?;
        let size = self.component.size();
        let mut numbers = [0.0; N];
        for (number, bytes) in numbers.iter_mut().zip(bytes.chunks_exact(size)) {
            let (value, largest) = match self.component {
                ComponentType::I8 => (f32::from(bytes[0] as i8), 127.0),
                ComponentType::U8 => (f32::from(bytes[0]), 255.0),
                ComponentType::I16 => (f32::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
                ComponentType::U16 => (f32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
                ComponentType::U32 => (word(bytes) as f32, u32::MAX as f32),
                ComponentType::F32 => (f32::from_bits(word(bytes)), 1.0),
            };
            let integer = self.component != ComponentType::F32;
            *number = if integer && self.normalised { (value / largest).max(-1.0) } else { value };
        }
        Some(numbers)
    }

    /// One element as an index.
    pub(super) fn index(&self, index: usize) -> Option<u32> {
        let bytes = self.element(index)?;
        match self.component {
            ComponentType::U8 => Some(u32::from(bytes[0])),
            ComponentType::U16 => Some(u32::from(u16::from_le_bytes([bytes[0], bytes[1]]))),
            ComponentType::U32 => Some(word(bytes)),
            ComponentType::I8 | ComponentType::I16 | ComponentType::F32 => None,
        }
    }
}

fn word(bytes: &[u8]) -> u32 {
    u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}

impl Document<'_> {
    /// An accessor of vectors of 2 or 3 numbers.
    pub(super) fn vectors(&self, place: &str, index: Index<Accessor>, shape: Type) -> Result<Elements<'_>, ModelError> {
        let elements = self.elements(place, index, shape)?;
        if elements.component == ComponentType::U32 {
            let place = format!("accessors[{}]", index.value());
            return Err(self.file.malformed(place, "numbers were expected, as floats or integers of 8 or 16 bits"));
        }
        Ok(elements)
    }

    /// An accessor of indices.
    pub(super) fn indices(&self, place: &str, index: Index<Accessor>) -> Result<Elements<'_>, ModelError> {
        let elements = self.elements(place, index, Type::Scalar)?;
        match elements.component {
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32 => Ok(elements),
            ComponentType::I8 | ComponentType::I16 | ComponentType::F32 => {
                let place = format!("accessors[{}]", index.value());
                Err(self.file.malformed(place, "indices were expected, as integers without sign"))
            }
        }
    }

    fn elements(&self, place: &str, index: Index<Accessor>, shape: Type) -> Result<Elements<'_>, ModelError> {
        let accessor = self.get(place, "accessors", index)?;
        let place = format!("accessors[{}]", index.value());
        let (Checked::Valid(found), Checked::Valid(component)) = (accessor.type_, accessor.component_type) else {
            return Err(self.file.malformed(place, "a type and a componentType of §3.6.2 were expected"));
        };
        if found != shape {
            return Err(self.file.malformed(place, format!("the type {shape:?} was expected, it is {found:?}")));
        }
        // A sparse accessor without a view is zeros, as many as it claims.
        let Some(view) = accessor.buffer_view else {
            return Err(self.file.unsupported(place, "an accessor without a bufferView (compressed, or all zeros)"));
        };
        let (view, bytes) = self.view(&place, view)?;
        let size = component.0.size() * shape.multiplicity();
        let stride = view.byte_stride.map_or(size, |stride| stride.0);
        if stride < size {
            let reason = format!("a byteStride of at least {size} was expected, it is {stride}");
            return Err(self.file.malformed(place, reason));
        }
        let offset = accessor.byte_offset.unwrap_or(USize64(0)).0;
        let Some(bytes) = strided(bytes, offset, accessor.count.0, stride as u64, size as u64) else {
            let reason = format!(
                "{} elements of {size} bytes were expected, one every {stride} from {offset} on, in a view of {} bytes",
                accessor.count.0,
                bytes.len()
            );
            return Err(self.file.malformed(place, reason));
        };
        let count = accessor.count.0 as usize;
        let sparse = match &accessor.sparse {
            Some(sparse) => self.replaced(&format!("{place}.sparse"), sparse, count, size)?,
            None => HashMap::new(),
        };
        Ok(Elements { bytes, stride, size, count, component: component.0, normalised: accessor.normalized, sparse })
    }

    fn replaced(
        &self,
        place: &str,
        sparse: &sparse::Sparse,
        count: usize,
        size: usize,
    ) -> Result<HashMap<usize, &[u8]>, ModelError> {
        let Checked::Valid(component) = sparse.indices.component_type else {
            return Err(self.file.malformed(place, "indices were expected, as integers without sign"));
        };
        let width = component.0.size();
        let (_, indices) = self.view(place, sparse.indices.buffer_view)?;
        let (_, values) = self.view(place, sparse.values.buffer_view)?;
        let indices = strided(indices, sparse.indices.byte_offset.0, sparse.count.0, width as u64, width as u64);
        let values = strided(values, sparse.values.byte_offset.0, sparse.count.0, size as u64, size as u64);
        let (Some(indices), Some(values)) = (indices, values) else {
            let reason = format!("{} elements were expected, its views have fewer", sparse.count.0);
            return Err(self.file.malformed(place, reason));
        };
        let mut replaced = HashMap::new();
        for (index, value) in indices.chunks_exact(width).zip(values.chunks_exact(size)) {
            let mut bytes = [0; 8];
            bytes[..width].copy_from_slice(index);
            let index = u64::from_le_bytes(bytes) as usize;
            if index >= count {
                return Err(self.file.malformed(place, format!("indices below {count} were expected, one is {index}")));
            }
            replaced.insert(index, value);
        }
        Ok(replaced)
    }
}

/// The bytes of `count` elements, if all are there.
fn strided(bytes: &[u8], offset: u64, count: u64, stride: u64, size: u64) -> Option<&[u8]> {
    let length = match count.checked_sub(1) {
        Some(steps) => steps.checked_mul(stride)?.checked_add(size)?,
        None => 0,
    };
    range(bytes, offset, length)
}
