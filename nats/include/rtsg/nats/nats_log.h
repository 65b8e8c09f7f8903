// NatsLog: a session in a stream of JetStream. The messages of the stream, one after the other, are the log.
//
// It works beside a log's writer and reader, which work on a file. What the writer has put into the file is stored
// record by record: a message is a record, so sequences count records. A record that is longer than the NATS server's
// messages takes several. A reader gets the stream as a file.
// Invariant: each record is stored once, in order, whatever happens to connections, to the NATS server or to this
// process: each names the sequence that it follows, and an answer that was lost is looked up. A stream that has more
// than this writer stored is left alone, with an error.
// Threading: a thread of its own; all functions on any.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

class NatsLog {
  public:
    struct Fetched {
        std::uint64_t messages = 0, bytes = 0;
    };
    /// Writes what is stored at the address into the new file. `progress` is told bytes read and all there are; false
    /// ends it with an error. Errors: no connection; nothing is stored there; messages were deleted; the file cannot be
    /// written.
    static Result<Fetched> fetch(const std::string& address, const std::filesystem::path& file,
                                 const std::function<bool(std::uint64_t, std::uint64_t)>& progress = {});

    enum class Begin : std::uint8_t {
        fresh,    // an error if something is stored there
        replace,  // what is stored there goes
        goOn,     // the file is written with what is stored there, and what comes behind it is stored, too
    };
    /// Stores what is written to `file` from now on. The file need not exist yet, but with `goOn` is there afterwards.
    /// Errors: as fetch(); no JetStream.
    static Result<std::unique_ptr<NatsLog>> start(const std::string& address, const std::filesystem::path& file,
                                                  Begin begin);
    /// Ends at once; what is not stored yet is not.
    ~NatsLog();

    /// The address without secrets.
    const std::string& address() const;
    std::uint64_t storedBytes() const;
    std::uint64_t storedMessages() const;
    /// Why nothing can be stored at present, or any more; empty if all is well.
    std::string failure() const;
    /// Waits until all that is in the file is stored. The writer must have closed it. Error: nothing went on for
    /// `patience`, or nothing will.
    Result<> finish(std::chrono::milliseconds patience = std::chrono::seconds(10));

  private:
    class Impl;
    explicit NatsLog(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
