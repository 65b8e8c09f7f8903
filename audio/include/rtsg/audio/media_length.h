// mediaSeconds: how long a sound or a film plays; for programs that load documents (BuildOptions::mediaLength).
//
// Threading: any thread.
#pragma once

#include <cstdint>
#include <optional>

#include <rtsg/core/resource.h>

namespace rtsg {

/// The length in seconds, from the file's header if possible. A sound in a film container without pictures is decoded
/// for it, up to `maximumSamples`. Nothing: the file is neither a sound nor a film, or cannot be read.
std::optional<double> mediaSeconds(const Resource& file, std::uint64_t maximumSamples);

}  // namespace rtsg
