// lasting: a table that is made once and never destroyed, for functions that look things up.
#pragma once

namespace rtsg {

/// Keeps the result of `make` for ever: a thread may still run frames while another one ends the process with exit(),
/// which destroys all other statics. Use it to initialise a static reference.
template <class Make>
const auto& neverDestroyed(Make make) {
    return *new auto(make());
}

}  // namespace rtsg
