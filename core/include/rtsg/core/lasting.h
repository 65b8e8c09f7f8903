// lasting: a table that is made once, for functions that look things up.
#pragma once

namespace rtsg {

/// What `make` returns, never destroyed: a thread may still run frames while another one ends the process with exit(),
/// which destroys all other statics. For the initialiser of a static reference.
template <class Make>
const auto& lasting(Make make) {
    return *new auto(make());
}

}  // namespace rtsg
