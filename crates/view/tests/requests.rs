//! Who is answered, and what malformed requests get.

use crate::client::Served;
use serde_json::json;

#[test]
fn the_page_comes_from_the_binary_and_loads_nothing_from_elsewhere() {
    let served = Served::new();
    let page = served.get("");
    assert_eq!(page.status, 200);
    let text = String::from_utf8(page.body).unwrap();
    let named = |attribute: &str| -> Vec<String> {
        let parts = text.split(attribute).skip(1);
        parts
            .map(|p| p.split('"').next().unwrap().to_owned())
            .collect()
    };
    let mut wanted = [named("href=\""), named("src=\"")].concat();
    let mut seen = 0;
    while let Some(name) = wanted.pop() {
        let asset = served.get(&name);
        assert_eq!(asset.status, 200, "{name}");
        let text = String::from_utf8(asset.body).unwrap();
        for line in text.lines() {
            // Modules import others; nothing is fetched from elsewhere.
            if let Some((_, from)) = line
                .split_once("\"./")
                .filter(|_| line.starts_with("import"))
            {
                wanted.push(from.split('"').next().unwrap().to_owned());
            }
            let line = line.replace("http://www.w3.org/2000/svg", "");
            assert!(!line.contains("://"), "{name}: {line}");
        }
        seen += 1;
        assert!(seen < 100, "imports in a circle are listed for ever");
    }
    assert!(seen > 8, "{seen}");
    for header in [
        "content-security-policy: default-src 'none'",
        "x-content-type-options: nosniff",
        "referrer-policy: no-referrer",
        "x-frame-options: DENY",
        "cache-control: no-store",
    ] {
        assert!(page.head.contains(header), "{header}: {}", page.head);
    }
}

#[test]
fn without_the_secret_the_host_and_the_origin_nothing_is_answered() {
    let served = Served::new();
    let host = served.host();
    let ask = |path: &str, headers: &str| {
        let request = format!("GET {path} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n");
        served.raw(request.as_bytes()).status
    };
    let own = format!("Host: {host}\r\n");
    let port = host.split(':').nth(1).unwrap();
    assert_eq!(ask("/token/", &own), 200);
    assert_eq!(ask("/token/", &format!("Host: localhost:{port}\r\n")), 200);
    for path in [
        "/", "/token", "/tokem/", "/TOKEN/", "/token2/", "//token/", "*",
    ] {
        assert_ne!(ask(path, &own), 200, "{path}");
    }
    // A name of somebody else's that was made to lead to this computer.
    for headers in [
        format!("Host: evil.example:{port}\r\n"),
        "Host: 127.0.0.1\r\n".into(),
        String::new(),
        format!("Host: {host}\r\nHost: evil.example\r\n"),
        format!("Host: {host}\r\nOrigin: http://evil.example\r\n"),
        format!("Host: {host}\r\nOrigin: null\r\n"),
        format!("Host: {host}\r\nSec-Fetch-Site: cross-site\r\n"),
    ] {
        let status = ask("/token/", &headers);
        assert!(status == 403 || status == 400, "{headers}: {status}");
    }
    // The same of requests that change something.
    let edit = |headers: &str| {
        let request = format!(
            "POST /token/undo HTTP/1.1\r\n{headers}Connection: close\r\nContent-Length: 2\r\n\r\n{{}}"
        );
        served.raw(request.as_bytes()).status
    };
    assert_eq!(
        edit(&format!("Host: {host}\r\nOrigin: http://{host}\r\n")),
        200
    );
    assert_eq!(
        edit(&format!("Host: {host}\r\nOrigin: http://evil.example\r\n")),
        403
    );
}

#[test]
fn no_request_reads_a_file() {
    let served = Served::new();
    for path in [
        "../secret.txt",
        "../../../../../../etc/passwd",
        "%2e%2e/secret.txt",
        "..%2fsecret.txt",
        "%2e%2e%2fsecret.txt",
        "..\\secret.txt",
        "./../secret.txt",
        "//etc/passwd",
        "/etc/passwd",
        "scene.toml",
        "fabric.toml",
        "plain.wif",
        "news/../../secret.txt",
        "picture.png/../secret.txt",
        "main.js%00.png",
    ] {
        let answered = served.get(path);
        assert!(matches!(answered.status, 400 | 404), "{path}: {answered:?}");
        let body = String::from_utf8_lossy(&answered.body);
        assert!(
            !body.contains("OUTSIDE") && !body.contains("root:"),
            "{path}"
        );
    }
    // Known good: the draft of the folder is listed, that beside the folder is not.
    let news = served.get("news?after=0&known=0").json();
    assert_eq!(news["document"]["drafts"], json!(["plain.wif"]));
    for draft in [
        "../secret.wif",
        "/etc/passwd.wif",
        "secret.wif",
        "..",
        "plain.wif/../plain.wif",
    ] {
        let message = served.refused(json!([{ "op": "draft", "fabric": 0, "draft": draft }]));
        assert!(!message.contains("OUTSIDE"), "{message}");
    }
}

#[test]
fn malformed_and_oversized_requests_are_refused_in_words() {
    let served = Served::new();
    let host = served.host();
    let raw = |text: String| served.raw(text.as_bytes());
    for garbage in [
        "\0\x01\x02",
        "GET",
        "GET / HTTP/9.9\r\n\r\n",
        "\r\n\r\n\r\n\r\n",
        "{}{}{}",
    ] {
        let status = raw(format!("{garbage}\r\n\r\n")).status;
        assert!(status == 0 || status >= 400, "{garbage:?}: {status}");
    }
    let long = "a".repeat(40_000);
    let head = raw(format!(
        "GET /token/{long} HTTP/1.1\r\nHost: {host}\r\n\r\n"
    ));
    assert!(matches!(head.status, 0 | 414 | 431), "{}", head.status);
    let head = raw(format!(
        "GET /token/ HTTP/1.1\r\nHost: {host}\r\nX-A: {long}\r\n\r\n"
    ));
    assert!(matches!(head.status, 0 | 431), "{}", head.status);
    let many: String = (0..500).map(|i| format!("X-{i}: 1\r\n")).collect();
    let head = raw(format!(
        "GET /token/ HTTP/1.1\r\nHost: {host}\r\n{many}\r\n"
    ));
    assert!(matches!(head.status, 0 | 400 | 431), "{}", head.status);

    let json_type = "Content-Type: application/json\r\n";
    let large = vec![b' '; 70 << 10];
    let answered = served.request("POST", "edit", json_type, &large);
    // It may be refused before it has been sent: the answer is lost then, or it is 413.
    assert!(matches!(answered.status, 0 | 413), "{answered:?}");
    let stated = format!(
        "POST /token/draft HTTP/1.1\r\nHost: {host}\r\nContent-Length: 99999999999\r\n\r\n"
    );
    assert_eq!(raw(stated).status, 413);
    let chunk = format!("5000\r\n{}\r\n", " ".repeat(0x5000));
    let chunked = format!(
        "POST /token/edit HTTP/1.1\r\nHost: {host}\r\n{json_type}Transfer-Encoding: chunked\r\n\r\n\
         {}0\r\n\r\n",
        chunk.repeat(5)
    );
    let status = raw(chunked).status;
    assert!(matches!(status, 0 | 413), "{status}");

    let answered = served.request("POST", "edit", "", b"{\"edits\":[]}");
    assert_eq!(answered.status, 415);
    let answered = served.request("POST", "edit", json_type, b"{\"edits\":[}");
    assert_eq!(answered.status, 400, "{answered:?}");
    assert!(answered.error().starts_with("the request: "));
    let deep = "[".repeat(60_000);
    let answered = served.request("POST", "edit", json_type, deep.as_bytes());
    assert_eq!(answered.status, 400);
    assert_eq!(served.get("news?after=x").status, 400);
    assert_eq!(served.get("picture.png").status, 404);
    for method in ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "BREW"] {
        assert_eq!(
            served.request(method, "edit", "", b"").status,
            405,
            "{method}"
        );
    }
    let answered = served.request("HEAD", "style.css", "", b"");
    assert_eq!((answered.status, answered.body.len()), (200, 0));
    // Whatever came, the session is as it was, and goes on.
    assert_eq!(served.session.revision(), 1);
    assert_eq!(served.edit(json!([])), 2);
}
