//! Why pictures of a board give no lens.

/// Each message is one line that says what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrateError {
    #[error(
        "the board is seen in {found} pictures, and {views} of these views differ, where {least} are needed; \
         check --squares (squares along the sides, one more than inner corners), and show the whole board at other \
         places and slants"
    )]
    TooFewViews {
        views: usize,
        found: usize,
        least: usize,
    },
    #[error(
        "the views are too much alike to tell the focal length; turn the board by 20 to 45 degrees about \
         both of its axes, and show it near the borders of the picture, too"
    )]
    Alike,
}
