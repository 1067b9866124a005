//! The message by which tools of ROS 2, such as `ros2 node list`, know nodes.

use super::bytes::Encoder;
use super::types::{Encode, Type};

/// What identifies a reader, a writer or a member of a domain: 16 bytes, and up to ROS 2 Humble 24.
pub type Gid = Vec<u8>;

/// `rmw_dds_common/msg/ParticipantEntitiesInfo`, the nodes of a member of a domain.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ParticipantEntitiesInfo {
    /// The member.
    pub gid: Gid,
    /// Its nodes.
    pub nodes: Vec<NodeEntitiesInfo>,
}

/// `rmw_dds_common/msg/NodeEntitiesInfo`, a node.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NodeEntitiesInfo {
    /// Its namespace, with a slash at its beginning.
    pub namespace: String,
    /// Its name.
    pub name: String,
    /// What it subscribes with.
    pub readers: Vec<Gid>,
    /// What it publishes with.
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
