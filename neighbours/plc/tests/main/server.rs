//! A server of Modbus TCP, after the "MODBUS Messaging on TCP/IP Implementation Guide V1.0b" (section 3.1.3) and the "MODBUS Application
//! Protocol Specification V1.1b3" (section 6): unit 1 with discrete input 5 set, input register 30 at -123, and bit 2 of holding
//! register 7 set.

use std::{
    io::{Read, Write},
    net::{Shutdown, SocketAddr, TcpListener, TcpStream},
    sync::{Arc, Mutex},
    thread,
};

/// What was asked, and who asks.
#[derive(Default)]
struct Seen {
    functions: Vec<u8>,
    clients: Vec<TcpStream>,
}

/// A server; it ends with the test.
pub(crate) struct Server {
    address: SocketAddr,
    seen: Arc<Mutex<Seen>>,
}

impl Server {
    pub(crate) fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("its address");
        let seen = Arc::<Mutex<Seen>>::default();
        let shared = Arc::clone(&seen);
        thread::spawn(move || {
            for client in listener.incoming().map_while(Result::ok) {
                let own = client.try_clone().expect("a client");
                shared.lock().expect("what was seen").clients.push(own);
                let shared = Arc::clone(&shared);
                thread::spawn(move || serve(client, &shared));
            }
        });
        Self { address, seen }
    }

    /// A source at which nobody listens.
    pub(crate) fn gone() -> String {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("its address");
        format!("modbus://{address}/1")
    }

    pub(crate) fn source(&self) -> String {
        format!("modbus://{}/1", self.address)
    }

    /// Ends every connection; it takes new ones.
    pub(crate) fn hang_up(&self) {
        let mut seen = self.seen.lock().expect("what was seen");
        for client in seen.clients.drain(..) {
            // It may have gone by itself.
            drop(client.shutdown(Shutdown::Both));
        }
    }

    /// Codes of all functions that were asked for.
    pub(crate) fn functions(&self) -> Vec<u8> {
        self.seen.lock().expect("what was seen").functions.clone()
    }
}

/// Answers until the client has gone.
fn serve(mut client: TcpStream, seen: &Mutex<Seen>) {
    // Transaction, protocol, length of what follows, unit; function, address, count.
    let mut request = [0; 12];
    while client.read_exact(&mut request).is_ok() {
        let (function, rest) = (request[7], &request[8..]);
        seen.lock().expect("what was seen").functions.push(function);
        let word = |at: usize| u16::from_be_bytes([rest[at], rest[at + 1]]);
        let mut answer = match (function, word(0), word(2)) {
            (2, 5, 1) => vec![function, 1, 1],
            (3, 7, 1) => vec![function, 2, 0, 1 << 2],
            (4, 30, 1) => {
                let [high, low] = (-123_i16).to_be_bytes();
                vec![function, 2, high, low]
            }
            // Illegal data address.
            _ => vec![function | 0x80, 2],
        };
        let mut whole = request[..4].to_vec();
        whole.extend((answer.len() as u16 + 1).to_be_bytes());
        whole.push(request[6]);
        whole.append(&mut answer);
        if client.write_all(&whole).is_err() {
            return;
        }
    }
}
