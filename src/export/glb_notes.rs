//! What a model's file tells of its joints: some of it is in no other file of a capture.

use serde_json::Value;

/// The `extras` of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointNote {
    /// Number of the node, as in `nodes.csv`.
    pub node: u32,
    pub certainty: f32,
    pub copy_of: Option<u32>,
}

/// Reads the joints of a GLB; `None` if it is none that we have written.
pub fn joints(glb: &[u8]) -> Option<Vec<JointNote>> {
    // Header of 12 bytes; then length, kind and text of the first chunk.
    let word = |at: usize| Some(u32::from_le_bytes(glb.get(at..at + 4)?.try_into().ok()?) as usize);
    if glb.get(..4)? != b"glTF" || glb.get(16..20)? != b"JSON" {
        return None;
    }
    let root: Value = serde_json::from_slice(glb.get(20..20usize.checked_add(word(12)?)?)?).ok()?;
    let number = |v: Option<&Value>| {
        v.and_then(Value::as_u64)
            .and_then(|n| u32::try_from(n).ok())
    };
    let joint = |node: &Value| {
        let (name, extras) = (node.get("name")?.as_str()?, node.get("extras")?);
        let digits = name.strip_prefix("node_")?.split('_').next()?;
        Some(JointNote {
            node: digits.parse().ok()?,
            certainty: extras
                .get("certainty")
                .and_then(Value::as_f64)
                .unwrap_or(0.0) as f32,
            copy_of: number(extras.get("copy_of")),
        })
    };
    Some(
        root.get("nodes")?
            .as_array()?
            .iter()
            .filter_map(joint)
            .collect(),
    )
}
