//! The binary part of a GLB and the accessors into it.

use gltf_json::accessor::{Accessor, ComponentType, GenericComponentType, Type};
use gltf_json::buffer::{Buffer, Target, View};
use gltf_json::validation::{Checked::Valid, USize64};
use gltf_json::{Index, Root};

/// Grows the one buffer; every view starts at a multiple of four bytes, as the format asks.
#[derive(Default)]
pub(super) struct BufferBuilder {
    pub bytes: Vec<u8>,
}

/// What the numbers of an accessor are.
#[derive(Clone, Copy)]
pub(super) struct Layout {
    pub component: ComponentType,
    pub shape: Type,
    /// Whole numbers stand for 0 to 1.
    pub normalized: bool,
}

impl Layout {
    pub const fn f32(shape: Type) -> Self {
        Self {
            component: ComponentType::F32,
            shape,
            normalized: false,
        }
    }

    pub const fn normalized(component: ComponentType, shape: Type) -> Self {
        Self {
            component,
            shape,
            normalized: true,
        }
    }
}

impl BufferBuilder {
    /// Fills up to the next multiple of four and returns where the buffer now ends.
    fn align(&mut self) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.bytes.len()
    }

    /// Appends the bytes as a view of their own.
    pub fn view(
        &mut self,
        root: &mut Root,
        data: impl Iterator<Item = u8>,
        target: Option<Target>,
    ) -> Index<View> {
        let offset = self.align();
        self.bytes.extend(data);
        root.push(View {
            buffer: Index::new(0),
            byte_length: USize64::from(self.bytes.len() - offset),
            byte_offset: Some(USize64::from(offset)),
            byte_stride: None,
            name: None,
            target: target.map(Valid),
            extensions: None,
            extras: None,
        })
    }

    /// Appends `count` elements as a view with one accessor.
    pub fn accessor(
        &mut self,
        root: &mut Root,
        layout: Layout,
        count: usize,
        data: impl Iterator<Item = u8>,
        target: Option<Target>,
    ) -> Index<Accessor> {
        let view = self.view(root, data, target);
        root.push(accessor(view, 0, layout, count))
    }

    /// Declares the buffer, if anything is in it, and returns its bytes; `uri` is the file that
    /// they go into, if they do not follow in the same one.
    pub fn finish(mut self, root: &mut Root, uri: Option<String>) -> Option<Vec<u8>> {
        if self.bytes.is_empty() {
            return None;
        }
        self.align();
        let byte_length = USize64::from(self.bytes.len());
        root.push(Buffer {
            byte_length,
            name: None,
            uri,
            extensions: None,
            extras: None,
        });
        Some(self.bytes)
    }
}

/// An accessor from byte `offset` of a view on; `count` must not be 0.
pub(super) fn accessor(view: Index<View>, offset: usize, layout: Layout, count: usize) -> Accessor {
    Accessor {
        buffer_view: Some(view),
        byte_offset: (offset > 0).then(|| USize64::from(offset)),
        count: USize64::from(count),
        component_type: Valid(GenericComponentType(layout.component)),
        extensions: None,
        extras: None,
        type_: Valid(layout.shape),
        min: None,
        max: None,
        name: None,
        normalized: layout.normalized,
        sparse: None,
    }
}

/// Little-endian bytes of rows of numbers.
pub(super) fn le_f32<const N: usize>(rows: &[[f32; N]]) -> impl Iterator<Item = u8> + '_ {
    rows.iter().flatten().flat_map(|x| x.to_le_bytes())
}

/// Smallest and largest value of every column; of no rows both are 0.
pub(super) fn bounds<const N: usize>(rows: &[[f32; N]]) -> ([f32; N], [f32; N]) {
    let first = rows.first().copied().unwrap_or([0.0; N]);
    rows.iter()
        .fold((first, first), |(mut low, mut high), row| {
            for (c, &x) in row.iter().enumerate() {
                low[c] = low[c].min(x);
                high[c] = high[c].max(x);
            }
            (low, high)
        })
}
