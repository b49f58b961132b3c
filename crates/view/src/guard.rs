//! Which requests come from a page of this session: the address holds a secret, and no page
//! of another origin may send any.

use hyper::HeaderMap;
use hyper::header::{HOST, HeaderName, ORIGIN};

/// Where a session is served, and the secret in its address.
#[derive(Clone, Debug)]
pub struct Guard {
    token: String,
    hosts: [String; 2],
    port: u16,
}

/// Why a request is not answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It was sent to another name: a name of somebody else's that was made to lead here.
    Host,
    /// A page of another origin sent it.
    Origin,
    /// Its path does not begin with the secret.
    Token,
}

impl Guard {
    /// The guard of a port, with a new secret of 128 bits from the system.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn new(port: u16) -> Result<Guard, String> {
        let mut secret = [0; 16];
        getrandom::fill(&mut secret).map_err(|e| format!("no random numbers: {e}"))?;
        Ok(Guard::with_token(
            port,
            secret.map(|byte| format!("{byte:02x}")).concat(),
        ))
    }

    /// The guard of a port with a secret that is known.
    pub fn with_token(port: u16, token: impl Into<String>) -> Guard {
        Guard {
            token: token.into(),
            hosts: [format!("127.0.0.1:{port}"), format!("localhost:{port}")],
            port,
        }
    }

    /// The address of the page.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token)
    }

    /// The part of a path that follows the secret, if host, origin and secret are right.
    ///
    /// # Errors
    /// What is not right.
    pub fn check<'a>(&self, headers: &HeaderMap, path: &'a str) -> Result<&'a str, Refusal> {
        let is_own = |host: &str| self.hosts.iter().any(|own| own == host);
        // A request has one host; of several, one may be meant for somebody else.
        let mut hosts = headers.get_all(HOST).iter();
        let host = hosts.next().and_then(|host| host.to_str().ok());
        if !host.is_some_and(is_own) || hosts.next().is_some() {
            return Err(Refusal::Host);
        }
        for origin in headers.get_all(ORIGIN) {
            let origin = origin.to_str().ok().and_then(|o| o.strip_prefix("http://"));
            if !origin.is_some_and(is_own) {
                return Err(Refusal::Origin);
            }
        }
        for site in headers.get_all(HeaderName::from_static("sec-fetch-site")) {
            // `none`: typed by the user.
            if site != "same-origin" && site != "none" {
                return Err(Refusal::Origin);
            }
        }
        let (token, rest) = path
            .strip_prefix('/')
            .and_then(|path| path.split_once('/'))
            .ok_or(Refusal::Token)?;
        match is_equal(token.as_bytes(), self.token.as_bytes()) {
            true => Ok(rest),
            false => Err(Refusal::Token),
        }
    }
}

/// Whether two secrets are equal, in a time that does not depend on where they differ.
fn is_equal(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |all, (a, b)| all | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyper::header::HeaderValue;

    fn check(
        host: &str,
        extra: &[(&'static str, &'static str)],
        path: &str,
    ) -> Result<String, Refusal> {
        let mut headers = HeaderMap::new();
        headers.insert(HOST, HeaderValue::from_str(host).unwrap());
        for (name, value) in extra {
            headers.append(*name, HeaderValue::from_static(value));
        }
        let guard = Guard::with_token(8080, "secret");
        guard.check(&headers, path).map(str::to_owned)
    }

    #[test]
    fn only_pages_of_the_session_pass() {
        let own = "127.0.0.1:8080";
        assert_eq!(check(own, &[], "/secret/a/b"), Ok("a/b".into()));
        assert_eq!(check("localhost:8080", &[], "/secret/"), Ok("".into()));
        assert_eq!(
            check(own, &[("origin", "http://127.0.0.1:8080")], "/secret/"),
            Ok("".into())
        );
        assert_eq!(
            check(own, &[("sec-fetch-site", "none")], "/secret/"),
            Ok("".into())
        );
        // A name of somebody else's that was made to lead here.
        for host in [
            "evil.example:8080",
            "127.0.0.1:80",
            "127.0.0.1",
            "127.0.0.1:8080.evil.example",
        ] {
            assert_eq!(check(host, &[], "/secret/"), Err(Refusal::Host), "{host}");
        }
        let two = [("host", "evil.example:8080")];
        assert_eq!(check(own, &two, "/secret/"), Err(Refusal::Host));
        for origin in [
            "null",
            "http://evil.example",
            "https://127.0.0.1:8080",
            "http://127.0.0.1:81",
        ] {
            let found = check(own, &[("origin", origin)], "/secret/");
            assert_eq!(found, Err(Refusal::Origin), "{origin}");
        }
        let cross = [("sec-fetch-site", "cross-site")];
        assert_eq!(check(own, &cross, "/secret/"), Err(Refusal::Origin));
        for path in [
            "/",
            "/secret",
            "//secret/",
            "/Secret/",
            "/secre/",
            "/secret2/",
            "secret/",
            "*",
        ] {
            assert_eq!(check(own, &[], path), Err(Refusal::Token), "{path}");
        }
    }

    #[test]
    fn every_session_has_a_secret_of_its_own() {
        let [a, b] = [(); 2].map(|()| Guard::new(1).unwrap());
        assert_eq!(a.token.len(), 32);
        assert_ne!(a.token, b.token);
        assert_eq!(a.address(), format!("http://127.0.0.1:1/{}/", a.token));
    }
}
