//! A way to a server that goes wrong when it is told to: it cuts, slows, answers 500, or is not there.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

/// What the way is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Way {
    Good,
    /// Every seventh connection is cut after some bytes of an answer.
    Cuts,
    /// Answers come piece by piece, with pauses.
    Slow,
    /// Every third request is answered by `500`.
    Fails,
    /// Connections are taken, and nothing comes.
    Hangs,
    /// Connections are cut at once.
    Gone,
}

impl Way {
    const ALL: [Self; 6] = [Self::Good, Self::Cuts, Self::Slow, Self::Fails, Self::Hangs, Self::Gone];
}

#[derive(Debug)]
struct Shared {
    way: AtomicU8,
    connections: AtomicUsize,
    requests: AtomicUsize,
    /// After so many requests the way is gone.
    last: AtomicUsize,
    ended: AtomicBool,
}

/// Listens on a port of its own and passes on what it hears.
#[derive(Debug)]
pub struct Proxy {
    pub address: SocketAddr,
    shared: Arc<Shared>,
}

impl Proxy {
    pub fn new(server: SocketAddr) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port is free");
        let address = listener.local_addr().expect("it listens");
        let shared = Arc::new(Shared {
            way: AtomicU8::new(0),
            connections: AtomicUsize::new(0),
            requests: AtomicUsize::new(0),
            last: AtomicUsize::new(usize::MAX),
            ended: AtomicBool::new(false),
        });
        let own = Arc::clone(&shared);
        thread::spawn(move || {
            for client in listener.incoming().flatten() {
                if own.ended.load(Ordering::Relaxed) {
                    return;
                }
                let own = Arc::clone(&own);
                thread::spawn(move || own.serve(&client, server));
            }
        });
        Self { address, shared }
    }

    /// Sets what the way is like from now on, and counts requests anew.
    pub fn set(&self, way: Way) {
        self.shared.way.store(way as u8, Ordering::Relaxed);
        self.shared.requests.store(0, Ordering::Relaxed);
        self.shared.last.store(usize::MAX, Ordering::Relaxed);
    }

    /// Lets the way end after so many requests.
    pub fn end_after(&self, requests: usize) {
        self.set(Way::Good);
        self.shared.last.store(requests, Ordering::Relaxed);
    }

    /// Returns how many requests came since the way was set.
    pub fn requests(&self) -> usize {
        self.shared.requests.load(Ordering::Relaxed)
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.shared.ended.store(true, Ordering::Relaxed);
        // It wakes whoever listens.
        drop(TcpStream::connect(self.address));
    }
}

impl Shared {
    fn way(&self) -> Way {
        if self.requests.load(Ordering::Relaxed) > self.last.load(Ordering::Relaxed) {
            return Way::Gone;
        }
        Way::ALL[usize::from(self.way.load(Ordering::Relaxed))]
    }

    fn serve(&self, client: &TcpStream, server: SocketAddr) {
        let number = self.connections.fetch_add(1, Ordering::Relaxed);
        let Ok(server) = TcpStream::connect(server) else { return };
        thread::scope(|scope| {
            scope.spawn(|| self.up(client, &server));
            self.down(&server, client, number);
            let _ = client.shutdown(Shutdown::Both);
            let _ = server.shutdown(Shutdown::Both);
        });
    }

    /// Passes requests on; each is one line that names a version of HTTP.
    fn up(&self, mut client: &TcpStream, mut server: &TcpStream) {
        let mut block = vec![0; 1 << 16];
        while let Ok(read @ 1..) = client.read(&mut block) {
            let lines = block[..read].split(|byte| *byte == b'\n');
            let begun = lines.filter(|line| line.trim_ascii_end().ends_with(b" HTTP/1.1")).count();
            let count = self.requests.fetch_add(begun, Ordering::Relaxed);
            match self.way() {
                Way::Gone => break,
                Way::Fails if begun > 0 && count % 3 == 2 => {
                    let _ = client.write_all(
                        b"HTTP/1.1 500 Internal Server Error\r\nContent-Length: 0\r\nConnection: close\r\n\r\n",
                    );
                    break;
                }
                _ => {
                    if server.write_all(&block[..read]).is_err() {
                        break;
                    }
                }
            }
        }
        let _ = server.shutdown(Shutdown::Both);
        let _ = client.shutdown(Shutdown::Both);
    }

    fn down(&self, mut server: &TcpStream, mut client: &TcpStream, number: usize) {
        let mut block = vec![0; 1 << 12];
        while let Ok(read @ 1..) = server.read(&mut block) {
            let mut bytes = &block[..read];
            match self.way() {
                Way::Gone => return,
                Way::Hangs => {
                    while self.way() == Way::Hangs && !self.ended.load(Ordering::Relaxed) {
                        thread::sleep(Duration::from_millis(20));
                    }
                    return;
                }
                Way::Cuts if number % 7 == 3 => bytes = &bytes[..bytes.len() / 2],
                Way::Slow => thread::sleep(Duration::from_millis(20)),
                _ => {}
            }
            if client.write_all(bytes).is_err() || bytes.len() < read {
                return;
            }
        }
    }
}
