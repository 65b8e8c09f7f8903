// LineSink: where lines of text go: a file, a pipe, datagrams, those who connect, a broker.
//
// Invariant: write() never waits, unless that was asked for. Lines that wait hold at most kMaxWaiting bytes, and the
// same again for each who is connected; who reads too slowly misses whole lines, and is told how many by a line
// {"missed":N}.
// Threading: write() and counts() on one thread; a thread of its own sends.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <rtsg/core/diagnostic.h>

#include "endpoint.h"

namespace rtsg::feeds {

struct SinkCounts {
    std::uint64_t lines = 0, bytes = 0;  // that were handed over
    std::uint64_t missed = 0;            // that somebody, or the file or broker, did not get
    std::size_t subscribers = 0;         // connections now
};

class LineSink {
  public:
    virtual ~LineSink() = default;
    /// `place` gets the real port. Errors: as for LineSource::open(). `waits`: write() waits for room, until a file or
    /// pipe has taken nothing for half a second.
    static Result<std::unique_ptr<LineSink>> open(Endpoint& endpoint, bool insecure, bool waits = false);
    /// `line` without its end.
    virtual void write(std::string line) = 0;
    /// Sends the waiting lines, for half a second at most. From then on counts() and failure() are final, and every
    /// line is missed.
    virtual void close() = 0;
    virtual SinkCounts counts() const = 0;
    /// Why nothing more can be written; empty while it can.
    virtual std::string failure() const = 0;
};

}  // namespace rtsg::feeds
