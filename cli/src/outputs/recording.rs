//! Recordings of maps: MCAP files with ROS 2 messages.

use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mrfgs::image::Plane;
use mrfgs::image::write;
use mrfgs::image::write::Growing;
use mrfgs::{Error, Result};
use mrfgs_ros::messages::{Encode, Header};
use mrfgs_ros::recording::Writer;

use crate::outputs::messages::{Content, Messages, Sink, Topic};

/// A recording being written. The file appears on [`finish`](Self::finish).
pub(crate) struct RecordedMaps {
    messages: Messages,
    file: File,
}

struct File {
    path: PathBuf,
    /// `None` before the first frame.
    writer: Option<Writer<BufWriter<Growing>>>,
}

impl RecordedMaps {
    /// Starts a recording at `path`.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot be written.
    pub(crate) fn new(path: &Path, messages: Messages) -> Result<Self> {
        write::check_path(path)?;
        let file = File { path: path.to_owned(), writer: None };
        Ok(Self { messages, file })
    }

    /// Adds the disparities of a frame, its camera and its `contents`; `header` is that of the left view, `sigma` the typical error in
    /// pixels, if known.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot be written.
    pub(crate) fn add(
        &mut self,
        header: &Header,
        map: &Plane<f32>,
        sigma: Option<f32>,
        contents: Vec<Content>,
    ) -> Result<()> {
        self.messages.put_frame(header, map, sigma, contents, &mut self.file)
    }

    /// Ends the recording, with its index.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot be written.
    pub(crate) fn finish(self) -> Result<()> {
        let File { path, writer } = self.file;
        let Some(writer) = writer else { return Ok(()) };
        let error = |e: std::io::Error| Error::write(&path, e);
        let file = writer.finish().map_err(error)?.into_inner().map_err(|e| error(e.into_error()))?;
        file.finish()
    }
}

impl Sink for File {
    fn put(&mut self, (topic, _): Topic, header: &Header, message: &impl Encode) -> Result<()> {
        let error = |e: std::io::Error| Error::write(&self.path, e);
        let writer = if let Some(writer) = &mut self.writer {
            writer
        } else {
            let file = BufWriter::new(Growing::new(&self.path)?);
            self.writer.insert(Writer::new(file).map_err(error)?)
        };
        writer.add(&format!("/{topic}"), header.stamp, message).map_err(error)
    }
}
