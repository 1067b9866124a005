//! Topics for Foxglove and other viewers with its WebSocket protocol (<https://github.com/foxglove/ws-protocol>), which show them live in
//! 2D and 3D.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;
use std::time::Duration;

use bytes::Bytes;
use mrfgs::error::Reason;
use mrfgs_ros::messages::{Encode, Stamp, definition};
use serde_json::{Value, json};
use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::{HeaderValue, StatusCode};
use tungstenite::{Error, Message, WebSocket};

/// The supported protocol versions, newest first. Both have all that is used here.
const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
const PROTOCOL: &str = "sec-websocket-protocol";
/// How long to listen to a viewer before sending it news.
const TURN: Duration = Duration::from_millis(10);
/// How long a viewer may take to receive a message.
const PATIENCE: Duration = Duration::from_secs(5);
/// The first byte of a topic's message.
const MESSAGE_DATA: u8 = 1;

/// Shows topics to connected viewers.
pub struct Viewer {
    shared: Arc<Mutex<Shared>>,
    address: SocketAddr,
}

#[derive(Default)]
struct Shared {
    /// The topics so far, each with its message type. The index is the topic's number.
    topics: Vec<(String, &'static str)>,
    viewers: Vec<Weak<Mutex<Waiting>>>,
}

/// The subscriptions of a viewer, and its pending messages.
#[derive(Default)]
struct Waiting {
    /// The topic of each subscription, by the viewer's number for it.
    subscriptions: BTreeMap<u32, usize>,
    /// The newest message of each topic, with its time; slow viewers skip older ones.
    newest: BTreeMap<usize, (Stamp, Bytes)>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Viewer {
    /// Listens at `address`, such as `localhost:8765`; port 0 lets the system choose.
    ///
    /// # Errors
    /// If it cannot listen there.
    pub fn new(address: &str) -> Result<Self, Reason> {
        let listener = TcpListener::bind(address).map_err(Reason::from)?;
        let address = listener.local_addr().map_err(Reason::from)?;
        let shared = Arc::new(Mutex::new(Shared::default()));
        let weak = Arc::downgrade(&shared);
        thread::spawn(move || {
            for stream in listener.incoming() {
                let Some(shared) = weak.upgrade() else { return };
                if let Ok(stream) = stream {
                    thread::spawn(move || serve(stream, &shared));
                }
            }
        });
        Ok(Self { shared, address })
    }

    /// The address it listens at.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Sends a message of `topic`, with its time, to all subscribers. The first message of a topic announces it.
    pub fn show<M: Encode>(&mut self, topic: &str, stamp: Stamp, message: &M) {
        let mut shared = locked(&self.shared);
        let number = shared.topics.iter().position(|(name, _)| name == topic).unwrap_or_else(|| {
            shared.topics.push((topic.to_owned(), M::NAME));
            shared.topics.len() - 1
        });
        shared.viewers.retain(|viewer| viewer.strong_count() > 0);
        let viewers: Vec<_> = shared.viewers.iter().filter_map(Weak::upgrade).collect();
        drop(shared);
        let mut bytes = None;
        for viewer in viewers {
            let mut waiting = locked(&viewer);
            if waiting.subscriptions.values().any(|topic| *topic == number) {
                let bytes = bytes.get_or_insert_with(|| Bytes::from(message.encode())).clone();
                waiting.newest.insert(number, (stamp, bytes));
            }
        }
    }
}

/// Serves a viewer until it leaves or the server is dropped.
fn serve(stream: TcpStream, shared: &Arc<Mutex<Shared>>) {
    let _ = stream.set_nodelay(true).and_then(|()| stream.set_read_timeout(Some(PATIENCE)));
    let Ok(mut socket) = tungstenite::accept_hdr(stream, choose) else { return };
    let _ = socket.get_ref().set_read_timeout(Some(TURN));
    let _ = socket.get_ref().set_write_timeout(Some(PATIENCE));
    let info = json!({"op": "serverInfo", "name": "mrfgs", "capabilities": [], "supportedEncodings": [], "metadata": {}});
    if socket.send(Message::text(info.to_string())).is_err() {
        return;
    }
    let waiting = Arc::new(Mutex::new(Waiting::default()));
    locked(shared).viewers.push(Arc::downgrade(&waiting));
    let weak = Arc::downgrade(shared);
    let mut told = 0;
    while let Some(shared) = weak.upgrade() {
        let new: Vec<Value> = {
            let topics = &locked(&shared).topics;
            let new =
                topics.iter().enumerate().skip(told).map(|(number, topic)| channel(number, topic)).collect();
            told = topics.len();
            new
        };
        drop(shared);
        if !new.is_empty()
            && socket.send(Message::text(json!({"op": "advertise", "channels": new}).to_string())).is_err()
        {
            return;
        }
        if tell(&mut socket, &waiting).is_err() {
            return;
        }
        match socket.read() {
            Ok(Message::Text(text)) => listen(&text, &waiting),
            Ok(_) => {}
            Err(Error::Io(error)) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(_) => return,
        }
    }
    let _ = socket.close(None);
    let _ = socket.flush();
}

/// Accepts the protocol version that a viewer offers.
#[allow(clippy::result_large_err, reason = "the type of tungstenite's callback")]
fn choose(request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
    let offered = request.headers().get_all(PROTOCOL).iter().filter_map(|value| value.to_str().ok());
    let offered: Vec<_> = offered.flat_map(|value| value.split(',')).map(str::trim).collect();
    let Some(chosen) = PROTOCOLS.into_iter().find(|protocol| offered.contains(protocol)) else {
        let mut refused =
            ErrorResponse::new(Some(format!("offer one of the protocols {}", PROTOCOLS.join(", "))));
        *refused.status_mut() = StatusCode::BAD_REQUEST;
        return Err(refused);
    };
    response.headers_mut().insert(PROTOCOL, HeaderValue::from_static(chosen));
    Ok(response)
}

/// A topic as announced to viewers.
fn channel(number: usize, (topic, kind): &(String, &'static str)) -> Value {
    json!({
        "id": number, "topic": topic, "encoding": "cdr", "schemaName": kind, "schema": definition(kind), "schemaEncoding": "ros2msg",
    })
}

/// Sends a viewer's pending messages.
fn tell(socket: &mut WebSocket<TcpStream>, waiting: &Mutex<Waiting>) -> tungstenite::Result<()> {
    let ready: Vec<_> = {
        let Waiting { subscriptions, newest } = &mut *locked(waiting);
        let newest = std::mem::take(newest);
        let wanted = subscriptions.iter().filter_map(|(id, topic)| Some((*id, newest.get(topic)?.clone())));
        wanted.collect()
    };
    for (subscription, (stamp, content)) in ready {
        let mut data = Vec::with_capacity(13 + content.len());
        data.push(MESSAGE_DATA);
        data.extend(subscription.to_le_bytes());
        data.extend(stamp.0.to_le_bytes());
        data.extend_from_slice(&content);
        socket.send(Message::binary(data))?;
    }
    Ok(())
}

/// Handles a viewer's message. Other operations of the protocol need capabilities that this server does not have.
fn listen(text: &str, waiting: &Mutex<Waiting>) {
    let Ok(said) = serde_json::from_str::<Value>(text) else { return };
    let list = |name: &str| said[name].as_array().cloned().unwrap_or_default().into_iter();
    let number = |value: &Value| value.as_u64().and_then(|number| u32::try_from(number).ok());
    let subscriptions = &mut locked(waiting).subscriptions;
    match said["op"].as_str() {
        Some("subscribe") => {
            subscriptions.extend(
                list("subscriptions")
                    .filter_map(|one| Some((number(&one["id"])?, number(&one["channelId"])? as usize))),
            );
        }
        Some("unsubscribe") => list("subscriptionIds").filter_map(|id| number(&id)).for_each(|id| {
            subscriptions.remove(&id);
        }),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mrfgs_ros::messages::{Header, Image, Type};
    use tungstenite::client::IntoClientRequest;

    fn connected(address: SocketAddr, protocol: &str) -> tungstenite::Result<WebSocket<TcpStream>> {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut request = format!("ws://{address}").into_client_request()?;
        request.headers_mut().insert(PROTOCOL, HeaderValue::from_str(protocol).unwrap());
        tungstenite::client(request, stream).map(|(socket, _)| socket).map_err(|_| Error::ConnectionClosed)
    }

    fn text(socket: &mut WebSocket<TcpStream>) -> Value {
        serde_json::from_str(socket.read().unwrap().to_text().unwrap()).unwrap()
    }

    #[test]
    fn viewers_get_what_they_subscribe_to() {
        let mut viewer = Viewer::new("127.0.0.1:0").unwrap();
        let image =
            |stamp| Image { header: Header { stamp: Stamp(stamp), ..Header::default() }, ..Image::default() };
        viewer.show("/a", Stamp(1), &image(1));
        assert!(connected(viewer.address(), "chat").is_err(), "control: another protocol");
        for protocol in PROTOCOLS {
            let mut socket = connected(viewer.address(), &format!("other, {protocol}")).unwrap();
            assert_eq!(text(&mut socket)["op"], "serverInfo");
            let told = text(&mut socket);
            assert_eq!((&told["op"], &told["channels"][0]["topic"]), (&json!("advertise"), &json!("/a")));
            assert_eq!(told["channels"][0]["schemaName"], Image::NAME);
            for nonsense in [
                "",
                "{",
                "[]",
                r#"{"op":"subscribe","subscriptions":7}"#,
                r#"{"op":"unsubscribe","subscriptionIds":[-1]}"#,
            ] {
                socket.send(Message::text(nonsense)).unwrap();
            }
            socket.send(Message::binary(vec![9; 99])).unwrap();
            let ask = json!({"op": "subscribe", "subscriptions": [{"id": 5, "channelId": 0}]});
            socket.send(Message::text(ask.to_string())).unwrap();
            // Messages are repeated until the subscription has arrived.
            socket.get_ref().set_read_timeout(Some(TURN)).unwrap();
            let data = loop {
                viewer.show("/b", Stamp(2), &image(2));
                viewer.show("/a", Stamp(3), &image(3));
                match socket.read() {
                    Ok(Message::Binary(data)) => break data,
                    Ok(Message::Text(_)) | Err(Error::Io(_)) => {}
                    other => panic!("{other:?}"),
                }
            };
            assert_eq!(data[..13], [1, 5, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0]);
            assert_eq!(data[13..], image(3).encode());
        }
    }
}
