//! Why a cloud gives no tree.

/// Each message is one line that says what to do. The name of the file is put before it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CloudError {
    #[error("a tree takes {least} points at least, and it holds {points}; scan it more finely")]
    TooFew { points: usize, least: usize },
    #[error("its points lie in one plane or line; give a cloud of a tree that stands along z")]
    Flat,
    #[error("nothing that hangs together stands in it; cut one tree out of the scan")]
    NoTree,
    #[error(
        "its tree does not reach the ground: the lowest wood is {gap_m:.1} m above it; scan the trunk, too"
    )]
    NoTrunk { gap_m: f64 },
    #[error(
        "{share_percent:.0} % of it do not hang together with the foot of the trunk, where points are \
         missing; scan the trunk more finely, or cut one tree out of the scan"
    )]
    Apart { share_percent: f64 },
    #[error(
        "what stands in it is {height_m:.2} m high and reaches {width_m:.1} m to the side, as ground does and \
         no tree; give a cloud of a tree that stands along z"
    )]
    Low { height_m: f64, width_m: f64 },
    #[error(
        "the tree would be {height_m:.3} m high; give the unit of the file with --unit, or another one than that which \
         is given"
    )]
    OddSize { height_m: f64 },
}
