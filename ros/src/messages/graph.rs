//! The message that announces nodes to ROS 2 tools such as `ros2 node list`.

use super::bytes::Encoder;
use super::types::{Encode, Type};

/// Identifies a reader, a writer or a participant: 16 bytes, or 24 up to ROS 2 Humble.
pub type Gid = Vec<u8>;

/// `rmw_dds_common/msg/ParticipantEntitiesInfo`, the nodes of a participant.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ParticipantEntitiesInfo {
    /// The participant.
    pub gid: Gid,
    /// Its nodes.
    pub nodes: Vec<NodeEntitiesInfo>,
}

/// `rmw_dds_common/msg/NodeEntitiesInfo`, a node.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NodeEntitiesInfo {
    /// The namespace, with leading slash.
    pub namespace: String,
    /// The name.
    pub name: String,
    /// The readers of its subscriptions.
    pub readers: Vec<Gid>,
    /// The writers of its publications.
    pub writers: Vec<Gid>,
}

impl Type for ParticipantEntitiesInfo {
    const NAME: &'static str = "rmw_dds_common/msg/ParticipantEntitiesInfo";
}

impl Encode for ParticipantEntitiesInfo {
    fn encode(&self) -> Vec<u8> {
        let mut to = Encoder::with_room_for(0);
        to.array(&self.gid);
        to.u32(self.nodes.len() as u32);
        for node in &self.nodes {
            to.string(&node.namespace);
            to.string(&node.name);
            for gids in [&node.readers, &node.writers] {
                to.u32(gids.len() as u32);
                for gid in gids {
                    to.array(gid);
                }
            }
        }
        to.finish()
    }
}
