//! The bytes that buffers and their views mean (§3.6.1), held against the bytes that are there.

use std::borrow::Cow;
use std::collections::HashMap;

use gltf::json::buffer::View;
use gltf::json::validation::USize64;
use gltf::json::{Index, Root};

use super::{Document, ModelError, ModelFile, uri};
use crate::models::file::{read_named, short};

/// What the buffers of a document hold.
pub(super) struct Buffers<'a> {
    /// Each file once, though several buffers name it.
    contents: Vec<Cow<'a, [u8]>>,
    /// Of each buffer, which of the contents, and its length there.
    buffers: Vec<(usize, usize)>,
}

impl<'a> Buffers<'a> {
    /// Reads all of them; `binary` is the chunk beside the JSON text.
    pub(super) fn load(file: &ModelFile<'_>, root: &Root, binary: Option<&'a [u8]>) -> Result<Self, ModelError> {
        let mut contents = Vec::new();
        let mut files = HashMap::new();
        let mut buffers = Vec::new();
        for (number, buffer) in root.buffers.iter().enumerate() {
            let place = format!("buffers[{number}]");
            let content = match &buffer.uri {
                None if number == 0 && binary.is_some() => {
                    contents.push(Cow::Borrowed(binary.unwrap_or_default()));
                    contents.len() - 1
                }
                None => return Err(file.malformed(place, "a uri was expected, it has none")),
                Some(text) => match uri::data(text) {
                    Some(bytes) => {
                        contents.push(Cow::Owned(bytes.map_err(|reason| file.malformed(&place, reason))?));
                        contents.len() - 1
                    }
                    None => {
                        let path = uri::path(text).ok_or_else(|| file.malformed(&place, not_a_path(text)))?;
                        let path = file.beside(&place, &path)?;
                        match files.get(&path) {
                            Some(content) => *content,
                            None => {
                                contents.push(Cow::Owned(read_named(&path)?));
                                files.insert(path, contents.len() - 1);
                                contents.len() - 1
                            }
                        }
                    }
                },
            };
            let there = contents[content].len();
            let length = usize::try_from(buffer.byte_length.0).ok().filter(|length| *length <= there);
            let length = length.ok_or_else(|| {
                file.malformed(&place, format!("it announces {} bytes, only {there} are there", buffer.byte_length.0))
            })?;
            buffers.push((content, length));
        }
        Ok(Self { contents, buffers })
    }

    fn get(&self, number: usize) -> Option<&[u8]> {
        let (content, length) = *self.buffers.get(number)?;
        self.contents[content].get(..length)
    }
}

/// What is wrong with a URI that is neither data nor a path.
pub(super) fn not_a_path(uri: &str) -> String {
    format!("a relative path was expected, percent-encoded UTF-8, it is {:?}", short(uri))
}

impl Document<'_> {
    /// A view and the bytes it shows; `place` names what looks through it.
    pub(super) fn view(&self, place: &str, index: Index<View>) -> Result<(&View, &[u8]), ModelError> {
        let view = self.get(place, "bufferViews", index)?;
        let place = format!("bufferViews[{}]", index.value());
        let buffer = view.buffer.value();
        let bytes = self.buffers.get(buffer);
        let bytes = bytes.ok_or_else(|| self.file.malformed(&place, format!("there is no buffers[{buffer}]")))?;
        let (offset, length) = (view.byte_offset.unwrap_or(USize64(0)).0, view.byte_length.0);
        range(bytes, offset, length).map(|bytes| (view, bytes)).ok_or_else(|| {
            let there = bytes.len();
            self.file.malformed(place, format!("{length} bytes from {offset} on, but buffers[{buffer}] has {there}"))
        })
    }
}

/// `length` bytes from `offset` on, if they are there.
pub(super) fn range(bytes: &[u8], offset: u64, length: u64) -> Option<&[u8]> {
    let start = usize::try_from(offset).ok()?;
    let length = usize::try_from(length).ok()?;
    bytes.get(start..start.checked_add(length)?)
}
