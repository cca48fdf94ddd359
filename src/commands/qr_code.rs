//! An address as a QR code for a phone that looks at the terminal. In: an address. Out: lines of text.

use qrcode::QrCode;
use qrcode::render::unicode::Dense1x2;

/// Black on bright white, as a code has it, whatever the colours of the terminal (ECMA-48).
const BLACK_ON_WHITE: &str = "\x1b[30;107m";
const RESET: &str = "\x1b[0m";

/// Returns the code of an address, two of its rows in a line; `None` for an address that is too long for any code.
pub fn qr_code(address: &str) -> Option<String> {
    let code = QrCode::new(address).ok()?;
    let text = code.render::<Dense1x2>().build();
    Some(text.lines().map(|line| format!("{BLACK_ON_WHITE}{line}{RESET}")).collect::<Vec<_>>().join("\n"))
}
