//! `mrfgs ros`.

mod args;
mod arrivals;
mod log;
mod matching;
mod publications;

use std::sync::Arc;
use std::thread;
use std::time::Duration;

use mrfgs_node::topics::Participant;

use crate::failure::{Failure, Result};
use crate::{console, stop};

pub(crate) use args::Args;
use args::gid_bytes;
use arrivals::{Arrivals, CameraTopics, of_network};
use log::Log;
use matching::Matching;
use publications::Publications;

/// Interval at which a wait for a pair checks for a stop.
const PATIENCE: Duration = Duration::from_millis(50);

pub(crate) fn run(args: &Args) -> Result<()> {
    let execution = args.execution.execution();
    args.also.check_messages("remove it")?;
    let (names, domain) = (args.names()?, args.domain()?);
    let cameras = CameraTopics::new(&names, args.prior_topic.prior_topic.as_deref())?;
    let mut matching = Matching::new(args, cameras.clone(), execution)?;
    stop::listen();
    let participant = Participant::new(domain).map_err(of_network)?;
    let mut publications = Publications::new(&participant, &names, &args.also)?;
    let arrivals = Arc::new(Arrivals::default());
    let subscriptions = cameras.subscribe(&participant, args.reliable)?;
    let node = [names.namespace(), names.node()];
    let announced = participant.announce(node, gid_bytes(), publications.iter(), &subscriptions);
    let _announcement = announced.map_err(of_network)?;
    if !args.quiet {
        console::say(&format!(
            "{} subscribes to {}{} and {} and publishes {}; domain {domain}",
            names.node(),
            cameras.clouds().map(|clouds| format!("{clouds}, ")).unwrap_or_default(),
            cameras.image(0),
            cameras.image(1),
            publications.names().join(", ")
        ));
    }
    let receiving = {
        let (arrivals, tolerance) = (Arc::clone(&arrivals), args.tolerance.unwrap_or(0));
        thread::spawn(move || arrivals.receive(subscriptions, tolerance, PATIENCE))
    };
    let mut log = Log::new(args.quiet);
    while stop::go_on().is_continue() && !receiving.is_finished() {
        let arrived = arrivals.next(PATIENCE);
        let are_heard = publications.have_listeners();
        if let Some(pair) = arrived {
            if are_heard {
                matching.publish(pair, arrivals.cameras(), &mut publications, &mut log)?;
            } else {
                log.unheard();
            }
        }
        log.tell(&cameras, &arrivals);
    }
    log.end(&arrivals);
    match receiving.is_finished().then(|| receiving.join()) {
        Some(Ok(ended)) => ended.map_err(of_network),
        Some(Err(_)) => Err(Failure::Failed("the image receiver failed".into())),
        None => Ok(()),
    }
}
