//! An HTTP server that gives out the manifest and the first chunk of a stream and leaves every other request hanging.

use std::{
    fs,
    io::{BufRead, BufReader, Write},
    net::{TcpListener, TcpStream},
    path::{Path, PathBuf},
    thread,
    time::Duration,
};

/// Serves `folder` on a free port of this machine until the program ends. Returns its address.
pub fn start(folder: PathBuf) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = format!("http://{}/", listener.local_addr().expect("an address"));
    thread::spawn(move || {
        for connection in listener.incoming().flatten() {
            let folder = folder.clone();
            thread::spawn(move || serve(&connection, &folder));
        }
    });
    address
}

fn serve(connection: &TcpStream, folder: &Path) -> Option<()> {
    let mut lines = BufReader::new(connection.try_clone().ok()?).lines();
    while let Some(Ok(request)) = lines.next() {
        let path = request.split(' ').nth(1)?.trim_start_matches('/').to_owned();
        while lines.next()?.ok().is_some_and(|line| !line.is_empty()) {}
        if path.ends_with(".glb") && !path.ends_with("00000.glb") {
            thread::sleep(Duration::from_secs(600));
            return None;
        }
        let body = fs::read(folder.join(&path)).ok()?;
        let mut connection = connection;
        write!(connection, "HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n", body.len()).ok()?;
        connection.write_all(&body).ok()?;
    }
    None
}
