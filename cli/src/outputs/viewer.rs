//! Live maps for Foxglove.

use mrfgs::image::Plane;
use mrfgs::{Error, Result};
use mrfgs_node::viewer::Viewer;
use mrfgs_ros::messages::{Encode, Header};

use crate::outputs::messages::{Content, Messages, Sink, Topic};

/// Shows maps to connected viewers.
pub(crate) struct ShownMaps {
    messages: Messages,
    viewer: Viewer,
}

impl ShownMaps {
    /// Serves these `messages` at `address`.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot listen there.
    pub(crate) fn new(address: &str, messages: Messages) -> Result<Self> {
        let viewer =
            Viewer::new(address).map_err(|reason| Error::write(format!("ws://{address}"), reason))?;
        Ok(Self { messages, viewer })
    }

    /// The URL for Foxglove.
    pub(crate) fn address(&self) -> String {
        format!("ws://{}", self.viewer.address())
    }

    /// Shows what [`RecordedMaps::add`](super::RecordedMaps::add) writes.
    ///
    /// # Errors
    /// Never fails: viewers may come and go.
    pub(crate) fn add(
        &mut self,
        header: &Header,
        map: &Plane<f32>,
        sigma: Option<f32>,
        contents: Vec<Content>,
    ) -> Result<()> {
        self.messages.put_frame(header, map, sigma, contents, &mut Shown(&mut self.viewer))
    }
}

struct Shown<'a>(&'a mut Viewer);

impl Sink for Shown<'_> {
    fn put(&mut self, (topic, _): Topic, header: &Header, message: &impl Encode) -> Result<()> {
        self.0.show(&format!("/{topic}"), header.stamp, message);
        Ok(())
    }
}
