//! Definitions of the written message types, which recordings store with the messages.

use std::fmt::Write as _;

const TIME: &str = "int32 sec\nuint32 nanosec\n";
const HEADER: &str = "builtin_interfaces/Time stamp\nstring frame_id\n";
const IMAGE: &str = "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n\
                     uint8[] data\n";
const REGION: &str = "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n";
const CAMERA_INFO: &str = "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\n\
                           float64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\n\
                           sensor_msgs/RegionOfInterest roi\n";
const DISPARITY: &str = "std_msgs/Header header\nsensor_msgs/Image image\nfloat32 f\nfloat32 t\n\
                         sensor_msgs/RegionOfInterest valid_window\nfloat32 min_disparity\nfloat32 max_disparity\n\
                         float32 delta_d\n";
const FIELD: &str = "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\n\
                     uint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n";
const POINTS: &str = "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n\
                      bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n";

/// Each type with its definition, and the types it contains besides those of a header.
const ALL: [(&str, &str, &[&str]); 4] = [
    ("sensor_msgs/msg/Image", IMAGE, &[]),
    ("sensor_msgs/msg/CameraInfo", CAMERA_INFO, &["sensor_msgs/RegionOfInterest"]),
    ("stereo_msgs/msg/DisparityImage", DISPARITY, &["sensor_msgs/Image", "sensor_msgs/RegionOfInterest"]),
    ("sensor_msgs/msg/PointCloud2", POINTS, &["sensor_msgs/PointField"]),
];

const PARTS: [(&str, &str); 5] = [
    ("std_msgs/Header", HEADER),
    ("builtin_interfaces/Time", TIME),
    ("sensor_msgs/Image", IMAGE),
    ("sensor_msgs/RegionOfInterest", REGION),
    ("sensor_msgs/PointField", FIELD),
];

/// The definition of a written type such as `sensor_msgs/msg/Image` and of all types in it, in the format `ros2msg`. Empty for any other
/// type.
#[must_use]
pub fn definition(name: &str) -> String {
    let Some((_, own, more)) = ALL.iter().find(|row| row.0 == name) else { return String::new() };
    let mut text = (*own).to_owned();
    for (part, definition) in PARTS {
        let is_of_header = ["std_msgs/Header", "builtin_interfaces/Time"].contains(&part);
        if is_of_header || more.contains(&part) {
            let _ = write!(text, "{}\nMSG: {part}\n{definition}", "=".repeat(80));
        }
    }
    text
}
