//! Clouds of points, and what their files say of them.

/// A point of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Where it is: x, y, z.
    pub position: [f32; 3],
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// Confidence 0 ..= 255.
    pub confidence: u8,
}

/// The camera whose frame points have: x to its right, y down, z forward.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Frame {
    /// The left camera of the pair that was matched; the rectified one, if the pair has been rectified.
    #[default]
    Matched,
    /// The left camera before rectification, as it really stands. It has the same centre.
    Original,
}

/// Points in one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// The points, row by row of the left image. Positions have the unit of the baseline.
    pub points: Vec<Point>,
    /// What positions count from.
    pub frame: Frame,
}

impl Cloud {
    /// What a file says of positions: frame and unit, in one line.
    #[must_use]
    pub fn about(&self) -> String {
        let camera = match self.frame {
            Frame::Matched => "the left camera",
            Frame::Original => "the original left camera, before rectification",
        };
        format!("frame of {camera}: x right, y down, z forward; unit that of the baseline")
    }
}
