//! The stand-in without the feature `live`: there is no viewer.

use mrfgs::error::Reason;
use mrfgs::image::Plane;
use mrfgs::{Error, Result};
use mrfgs_ros::messages::Header;

use crate::outputs::messages::{Content, Messages};

/// The error message that names the missing feature and the remedy.
pub(crate) const WITHOUT_LIVE: &str = "this program was built without the feature `live`: take one of its packages, or build it with \
     `cargo install --locked mrfgs-cli --features live`";

/// No maps are shown.
pub(crate) enum ShownMaps {}

impl ShownMaps {
    /// Serves nothing.
    ///
    /// # Errors
    /// [`Error::Write`], always.
    pub(crate) fn new(address: &str, _: Messages) -> Result<Self> {
        Err(Error::write(format!("ws://{address}"), Reason::of_request(WITHOUT_LIVE)))
    }

    pub(crate) fn address(&self) -> String {
        match *self {}
    }

    pub(crate) fn add(&mut self, _: &Header, _: &Plane<f32>, _: Option<f32>, _: Vec<Content>) -> Result<()> {
        match *self {}
    }
}
