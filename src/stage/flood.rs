//! One iteration within a level: [`dependency`](super::dependency), then [`belief`](super::belief).
//!
//! (As one stage, it can sum beliefs while their messages are in registers or caches. The values are those of
//! the two stages.)

use super::{Data, Descriptor, Volume, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| {
        let messages = [Volume::Dependency(z), Volume::Down(z), Volume::Up(z)].map(Data::Volume);
        let summands = [Volume::Belief(z), Volume::Evidence(z)].map(Data::Volume);
        let graph = [Data::Members(z), Data::Incoming(z), Data::Windows(z)];
        summands.into_iter().chain(messages).chain(graph).collect()
    },
    writes: |z| volumes(&[Volume::Dependency(z), Volume::Belief(z)]),
    joins: true,
    cell: 0.6,
    ..Descriptor::NONE
};
