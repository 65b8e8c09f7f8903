// LineSource: where bytes of a feed come from.
//
// Threading: read() on a thread of its own, all else before it.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include <rtsg/core/diagnostic.h>

#include "endpoint.h"

namespace rtsg::feeds {

/// Takes the bytes that a source reads. Streams are connections, or datagrams of one socket.
class LineTaker {
  public:
    virtual ~LineTaker() = default;
    /// More of a stream. It may wait until there is room, if `mayWait`; otherwise it takes what it can. Returns false
    /// if nothing more is wanted.
    virtual bool came(std::uint64_t stream, std::string_view bytes, bool mayWait) = 0;
    /// The stream pauses: the rest of its text counts as a line. `over`: the stream has ended.
    virtual void paused(std::uint64_t stream, bool over) = 0;
    /// The system has left out so many datagrams before this one.
    virtual void lost(std::uint64_t datagrams) = 0;
    /// Something else happened that the user should know.
    virtual void note(std::string text) = 0;
    /// The source cannot be read to its end, for this reason.
    virtual void broke(std::string text) = 0;
};

class LineSource {
  public:
    virtual ~LineSource() = default;
    /// Opens it. `place` gets the real port. Errors: those of the system or a broker; an address that others can reach,
    /// unless `insecure`.
    static Result<std::unique_ptr<LineSource>> open(Endpoint& endpoint, bool insecure);
    /// Reads until the end, or until `stop` is readable.
    virtual void read(LineTaker& taker, int stop) = 0;
    /// A regular file, which waits for its reader.
    virtual bool isFile() const { return false; }
};

}  // namespace rtsg::feeds
