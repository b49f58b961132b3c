//! The program `organza`; everything it does lies in `crates/cli`.

fn main() -> std::process::ExitCode {
    organza_cli::run(std::env::args_os())
}
