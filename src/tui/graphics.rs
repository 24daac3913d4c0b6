//! How pictures reach the terminal: by an image protocol where it has one, else as half blocks,
//! else as letters.

use super::raster::Raster;
use super::theme::{Depth, is_set};
use super::tty::{Input, Tty};
use ratatui::layout::Size;
use ratatui_image::picker::ProtocolType;
use ratatui_image::picker::cap_parser::{Parser, QueryStdioOptions, Response};
use ratatui_image::protocol::{Protocol, iterm2::Iterm2, kitty::Kitty, sixel::Sixel};
use std::io::{self, Write, stdout};
use std::time::{Duration, Instant};

/// The user's choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Preview {
    /// Ask the terminal.
    #[default]
    Auto,
    /// Do not ask.
    HalfBlocks,
    Kitty,
    Sixel,
    Iterm2,
}

/// How pictures are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One letter a cell, for terminals without colour.
    Letters,
    HalfBlocks,
    Kitty,
    Sixel,
    Iterm2,
}

/// What is known of the terminal's pictures.
#[derive(Clone, Copy, Debug)]
pub struct Graphics {
    pub kind: Kind,
    /// Dots in a cell, across and down.
    pub cell_dots: (u16, u16),
    /// Whether a picture is packed before it is sent; worth its time only over a network.
    pack: bool,
    /// The terminal did not answer in time: its answer may still come and is not to be taken for
    /// keys.
    pub late: bool,
    sent: u32,
}

/// Two names for pictures, used in turn: kitty shows the old one until the new one is whole.
const KITTY_IDS: [u32; 2] = [0x00a2_b041, 0x00a2_b042];

impl Graphics {
    /// Pictures made of characters.
    pub fn characters(depth: Depth) -> Self {
        let kind = if depth == Depth::None {
            Kind::Letters
        } else {
            Kind::HalfBlocks
        };
        Self {
            kind,
            cell_dots: (1, 2),
            pack: false,
            late: false,
            sent: 0,
        }
    }

    /// Asks the terminal, for at most `limit`. It must be in raw mode, and nobody else may read
    /// from it.
    ///
    /// # Errors
    /// The terminal cannot be written to or read from.
    pub fn ask(tty: &Tty, wanted: Preview, depth: Depth, limit: Duration) -> io::Result<Self> {
        let mut graphics = Self::characters(depth);
        if depth == Depth::None || wanted == Preview::HalfBlocks {
            return Ok(graphics);
        }
        let mut query = QueryStdioOptions {
            kitty_compression: true,
            ..QueryStdioOptions::default()
        };
        if is_set("WEZTERM_EXECUTABLE") || is_set("KONSOLE_VERSION") {
            // Both claim kitty's protocol without its placeholders.
            query.blacklist_protocols = vec![ProtocolType::Kitty, ProtocolType::Sixel];
        }
        // tmux is asked as a terminal of its own: passing through it would need its options
        // changed.
        let mut out = stdout();
        out.write_all(Parser::query(false, query).as_bytes())?;
        out.flush()?;
        let (answers, late) = answers(tty, limit)?;
        graphics.late = late;
        graphics.pack = answers.contains(&Response::KittyCompression) && is_set("SSH_CONNECTION");
        if let Some((kind, cell_dots)) =
            choose(wanted, &answers, iterm2_by_name(), cell_by_window())
        {
            (graphics.kind, graphics.cell_dots) = (kind, cell_dots);
        }
        Ok(graphics)
    }

    /// Makes a picture ready to be put on the screen; `None` if this kind of terminal is not sent
    /// pictures.
    pub fn encode(&mut self, raster: Raster, cells: Size) -> Option<Protocol> {
        let picture =
            image::RgbImage::from_raw(raster.size.width, raster.size.height, raster.pixels)?.into();
        match self.kind {
            Kind::Letters | Kind::HalfBlocks => None,
            Kind::Kitty => {
                self.sent = self.sent.wrapping_add(1);
                let id = KITTY_IDS[self.sent as usize % 2];
                Kitty::new(picture, cells, id, false, self.pack)
                    .ok()
                    .map(Protocol::Kitty)
            }
            Kind::Sixel => Sixel::new(picture, cells, false).ok().map(Protocol::Sixel),
            Kind::Iterm2 => Iterm2::new(picture, cells, false)
                .ok()
                .map(Protocol::ITerm2),
        }
    }

    /// What is sent to the terminal at the end, so that it forgets the pictures.
    pub fn farewell(&self) -> String {
        if self.kind != Kind::Kitty {
            return String::new();
        }
        KITTY_IDS
            .map(|id| format!("\x1b_Ga=d,d=I,i={id},q=2\x1b\\"))
            .concat()
    }
}

/// Collects answers until the one that every terminal gives last; whether that one did not come.
fn answers(tty: &Tty, limit: Duration) -> io::Result<(Vec<Response>, bool)> {
    let until = Instant::now() + limit;
    let (mut parser, mut all, mut bytes) = (Parser::new(), Vec::new(), [0; 256]);
    loop {
        let left = until.saturating_duration_since(Instant::now());
        match tty.wait(left) {
            Input::Ready => {
                let n = tty.read(&mut bytes)?;
                all.extend(bytes[..n].iter().flat_map(|b| parser.push(char::from(*b))));
                if all.contains(&Response::Status) {
                    return Ok((all, false));
                }
            }
            Input::Gone => return Err(io::ErrorKind::BrokenPipe.into()),
            Input::Quiet => {}
        }
        if left.is_zero() {
            return Ok((all, true));
        }
    }
}

/// The best protocol on offer; none is of use without the size of a cell in dots.
fn choose(
    wanted: Preview,
    answers: &[Response],
    iterm2: bool,
    window_cell: Option<(u16, u16)>,
) -> Option<(Kind, (u16, u16))> {
    let answered = answers.iter().find_map(|a| match a {
        Response::CellSize(size) => *size,
        _ => None,
    });
    let cell = answered
        .or(window_cell)
        .filter(|(w, h)| (3..=100).contains(w) && (3..=200).contains(h))?;
    let kind = match wanted {
        Preview::HalfBlocks => return None,
        Preview::Kitty => Kind::Kitty,
        Preview::Sixel => Kind::Sixel,
        Preview::Iterm2 => Kind::Iterm2,
        Preview::Auto if answers.contains(&Response::Kitty) => Kind::Kitty,
        Preview::Auto if iterm2 => Kind::Iterm2,
        Preview::Auto if answers.contains(&Response::Sixel) => Kind::Sixel,
        Preview::Auto => return None,
    };
    Some((kind, cell))
}

/// Terminals with iTerm2's protocol, which cannot be asked for. Inside tmux the name is that of
/// another terminal.
fn iterm2_by_name() -> bool {
    let known = [
        "iTerm",
        "WezTerm",
        "mintty",
        "vscode",
        "Tabby",
        "rio",
        "WarpTerminal",
    ];
    let names = ["TERM_PROGRAM", "LC_TERMINAL"].map(|v| std::env::var(v).unwrap_or_default());
    !is_set("TMUX") && known.iter().any(|k| names.iter().any(|n| n.contains(k)))
}

fn cell_by_window() -> Option<(u16, u16)> {
    let window = ratatui::crossterm::terminal::window_size().ok()?;
    Some((
        window.width.checked_div(window.columns)?,
        window.height.checked_div(window.rows)?,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_the_best_protocol_that_can_work() {
        use Response::{CellSize, Kitty, Sixel, Status};
        let cell = CellSize(Some((9, 18)));
        for (wanted, answers, iterm2, expected) in [
            (Preview::Auto, vec![], false, None),
            (Preview::Auto, vec![Status], true, None),
            (Preview::Auto, vec![cell.clone(), Status], false, None),
            (
                Preview::Auto,
                vec![Kitty, Sixel, cell.clone()],
                true,
                Some(Kind::Kitty),
            ),
            (
                Preview::Auto,
                vec![Sixel, cell.clone()],
                false,
                Some(Kind::Sixel),
            ),
            (
                Preview::Auto,
                vec![Sixel, cell.clone()],
                true,
                Some(Kind::Iterm2),
            ),
            (
                Preview::Auto,
                vec![Sixel, CellSize(Some((0, 0)))],
                false,
                None,
            ),
            (Preview::HalfBlocks, vec![Kitty, cell.clone()], false, None),
            (
                Preview::Sixel,
                vec![Kitty, cell.clone()],
                false,
                Some(Kind::Sixel),
            ),
        ] {
            let kind = choose(wanted, &answers, iterm2, None).map(|c| c.0);
            assert_eq!(kind, expected, "{wanted:?} {answers:?} {iterm2}");
        }
        assert_eq!(
            choose(Preview::Auto, &[Kitty], false, Some((8, 16))),
            Some((Kind::Kitty, (8, 16)))
        );
    }
}
