//! Snapshots and movies of a recording, and pictures of a map, rendered by the page in a headless
//! browser.
//!
//! A temporary server on this machine serves the page with the recording or the map; a script
//! beside the page (`viewer/pictures`) drives the browser and reports errors to the user. This
//! module renders nothing itself.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use recording::location::recording_at;
use serde::Serialize;
use thiserror::Error;

use super::{FoxgloveServerError, NO_PAGE_HERE, StaticFileServer, Token, http_gateway};
use system::exit_code::{BAD_INPUT, FAILED};

/// The environment variable with the order for the browser driver.
const ORDER_VARIABLE: &str = "MAES_CAPTURE";

const FREE_PORT: &str = "127.0.0.1:0";

/// What to render.
#[derive(Debug, Args)]
pub struct CaptureArgs {
    /// The recording (.mcap), or the rosbag2 folder of one
    #[arg(value_parser = PathBufValueParser::new().try_map(recording_at))]
    pub file: PathBuf,
    /// Size of the image in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = size)]
    pub size: [u32; 2],
    /// Point the camera at this agent instead of the whole map
    #[arg(long, value_name = "ID")]
    pub agent: Option<u32>,
    /// Layers to draw, for example walls,unexplored,trails,labels [default: those of the page]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub layers: Option<Vec<String>>,
    /// From where the whole map is seen; top has x to the right and y upwards, front x to the
    /// right, side y to the right
    #[arg(long, value_enum, value_name = "WHERE", default_value_t, conflicts_with = "agent")]
    pub camera: Camera,
    /// Colour around the map; white is for print
    #[arg(long, value_enum, value_name = "COLOUR", default_value_t)]
    pub background: Background,
    /// The folder of the page [default: the one that was built here]
    #[arg(long, value_name = "DIR")]
    pub page: Option<PathBuf>,
}

/// From where the whole map is seen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Camera {
    /// From above a corner.
    #[default]
    Corner,
    Top,
    Front,
    Side,
}

/// What is around the map.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Background {
    #[default]
    Dark,
    White,
}

/// Sim time of a snapshot or of a movie.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(untagged)]
pub enum CaptureTime {
    /// A single image.
    Snapshot {
        /// Sim time, s.
        at: f64,
    },
    Movie {
        /// Sim time of the first frame, s; the start of the recording if `None`.
        from: Option<f64>,
        /// Sim time of the last frame, s; the end of the recording if `None`.
        to: Option<f64>,
        /// Duration of the movie, s.
        seconds: f64,
        /// Frames per second.
        fps: u32,
    },
}

/// What to render of a map.
#[derive(Debug, Clone, Copy)]
pub struct MapPicture<'a> {
    /// A file in a M3DM format.
    pub map: &'a Path,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// What lies beyond this share of the map's length along an axis (`x`, `y` or `z`) is left out.
    pub cut: Option<(char, f64)>,
    /// The folder of the page; that which was built here if `None`.
    pub page: Option<&'a Path>,
}

/// Time at which the page shows a map, of which all is known from the start, s.
const MAP_TIME_S: f64 = 5.0;

/// Why nothing was rendered.
#[derive(Debug, Error)]
pub enum CaptureError {
    /// The page cannot be served.
    #[error(transparent)]
    FoxgloveServer(#[from] FoxgloveServerError),
    /// The page was not built.
    #[error("{NO_PAGE_HERE}")]
    NoPage,
    /// The page has no browser driver beside it.
    #[error("{}: no such file; expected it beside the folder of the page, as in a checkout and in a release", .0.display())]
    NoDriver(PathBuf),
    /// The browser driver cannot be started.
    #[error("Node.js 20.19 or later is required for snapshots and movies: {0}")]
    Node(std::io::Error),
    /// The driver has reported an error, to the user.
    #[error("nothing was rendered")]
    Driver {
        /// Whether the request was not legal.
        is_bad_input: bool,
    },
}

/// The order for the browser driver, as JSON.
#[derive(Serialize)]
struct DriverOrder<'a> {
    url: String,
    out: &'a Path,
    #[serde(flatten)]
    view: &'a View<'a>,
    #[serde(flatten)]
    time: CaptureTime,
}

/// A cut of a map.
#[derive(Serialize)]
struct Cut {
    axis: char,
    share: f64,
}

/// Renders into the file `out`: PNG for a snapshot, MP4 or GIF for a movie.
///
/// # Errors
/// If the page, the browser or the driver is missing, or the order is not legal; then there is no
/// file.
///
/// # Panics
/// Never: an order is plain data.
pub fn take(args: &CaptureArgs, time: CaptureTime, out: &Path) -> Result<(), CaptureError> {
    let CaptureArgs { size, agent, camera, background, .. } = *args;
    let view = View { size, agent, layers: args.layers.as_deref(), cut: None, camera, background };
    render(&args.file, args.page.as_deref(), &view, time, out)
}

/// Renders a map into the PNG file `out`, with its walls and labels in metres.
///
/// # Errors
/// If the page, the browser or the driver is missing, or the map is no map; then there is no file.
///
/// # Panics
/// Never: an order is plain data.
pub fn take_map(picture: &MapPicture<'_>, out: &Path) -> Result<(), CaptureError> {
    let cut = picture.cut.map(|(axis, share)| Cut { axis, share });
    let layers = ["walls".to_owned()];
    let (camera, background) = (Camera::Corner, Background::Dark);
    let view = View { size: picture.size, agent: None, layers: Some(&layers), cut, camera, background };
    render(picture.map, picture.page, &view, CaptureTime::Snapshot { at: MAP_TIME_S }, out)
}

/// What is in the image, and how large it is.
#[derive(Serialize)]
struct View<'a> {
    size: [u32; 2],
    agent: Option<u32>,
    layers: Option<&'a [String]>,
    cut: Option<Cut>,
    camera: Camera,
    background: Background,
}

fn render(
    subject: &Path,
    page: Option<&Path>,
    view: &View<'_>,
    time: CaptureTime,
    out: &Path,
) -> Result<(), CaptureError> {
    let page = http_gateway::page(page)?.ok_or(CaptureError::NoPage)?;
    let take = page.join("../pictures/take.mjs");
    if !take.is_file() {
        return Err(CaptureError::NoDriver(take));
    }
    let server = StaticFileServer::open(FREE_PORT, &page, subject, None, Token::draw()?, &[])?;
    let out = std::path::absolute(out).map_err(FoxgloveServerError::System)?;
    let order = DriverOrder { url: server.url(), out: &out, view, time };
    let mut driver = Command::new("node");
    driver.arg(take);
    // Arguments are seen by all users of the machine, and the address has the token.
    driver.env(ORDER_VARIABLE, serde_json::to_string(&order).expect("an order is plain data"));
    // The driver notices by itself when this process ends.
    let status = driver.stdin(Stdio::null()).status();
    match status.map_err(CaptureError::Node)?.code() {
        Some(0) => Ok(()),
        code => Err(CaptureError::Driver { is_bad_input: code == Some(BAD_INPUT.into()) }),
    }
}

/// The exit code of a failure.
#[must_use]
pub fn exit_code(error: &CaptureError) -> u8 {
    match error {
        CaptureError::Driver { is_bad_input: true }
        | CaptureError::FoxgloveServer(FoxgloveServerError::Page { .. }) => BAD_INPUT,
        _ => FAILED,
    }
}

/// Width and height of an image, pixels, as in `1280x720`.
///
/// # Errors
/// What is expected.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let sides: Option<Vec<u32>> = text.split('x').map(|side| side.parse().ok()).collect();
    match sides.as_deref() {
        Some(&[width, height]) if (16..=8192).contains(&width) && (16..=8192).contains(&height) => Ok([width, height]),
        _ => Err("expected width and height in pixels, each from 16 to 8192, such as 1280x720".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(size("1280x720"), Ok([1280, 720]));
        for wrong in ["1280", "0x720", "1280x720x3", "axb", "9000x100", ""] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn order_is_flat_json() {
        let order = DriverOrder {
            url: "u".to_owned(),
            out: Path::new("/o.png"),
            view: &View {
                size: [1, 2],
                agent: None,
                layers: Some(&["walls".to_owned()]),
                cut: Some(Cut { axis: 'z', share: 0.5 }),
                camera: Camera::Top,
                background: Background::White,
            },
            time: CaptureTime::Snapshot { at: 1.5 },
        };
        let expected = serde_json::json!({ "url": "u", "out": "/o.png", "size": [1, 2], "agent": null, "layers": ["walls"], "cut": { "axis": "z", "share": 0.5 }, "camera": "top", "background": "white", "at": 1.5 });
        assert_eq!(serde_json::to_value(&order).unwrap(), expected);
    }
}
