mod pxi;
use std::io::{Read, Write};

fn main() {
    let (mut bytes, mut pixels, mut file) = (Vec::new(), Vec::new(), std::ptr::null_mut());
    std::io::stdin().read_to_end(&mut bytes).expect("a file on standard input");
    let (mut error, mut output): (pxi::Error, pxi::Output) = (pxi::blank(), pxi::blank());
    let request = pxi::Request { width: 64, ..pxi::blank() };
    unsafe {
        if pxi::pxi_open(bytes.as_ptr(), bytes.len(), std::ptr::null(), &mut file, &mut error) == 0
            && pxi::pxi_measure(file, &request, &mut output, &mut error) == 0 {
            pixels.resize(output.bytes, 0);
            pxi::pxi_render(file, &request, pixels.as_mut_ptr(), pixels.len(), 0, &mut error);
        }
        pxi::pxi_close(file);
    }
    if error.status != 0 { eprintln!("{}", String::from_utf8_lossy(&error.message).trim_end_matches('\0')); std::process::exit(1) }
    print!("P6 {} {} 255\n", output.width, output.height);
    pixels.chunks(4).for_each(|pixel| std::io::stdout().write_all(&pixel[..3]).expect("standard output"));
}
