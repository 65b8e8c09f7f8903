// NatsLog: stores a session in a stream of JetStream. The messages of the stream in order are the log.
//
// It works beside a log's writer and reader, which use a file. Each record of the file is stored as one message, so
// sequences count records; a record that is longer than the NATS server's messages takes several. A reader gets the
// stream as a file. Invariant: each record is stored once, in order, also if connections, the NATS server or this
// process fail: each message names the sequence that it follows, and a lost answer is looked up. A stream with more
// messages than this writer has stored is not changed, with an error. Threading: a thread of its own; all functions on
// any.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

class NatsLog {
  public:
    /// Numbers of messages that the store no longer has, from the first to the last of each run.
    using Missing = std::vector<std::pair<std::uint64_t, std::uint64_t>>;
    struct Fetched {
        std::uint64_t last = 0, bytes = 0;  // the number of the last message, and the bytes that were written
        Missing missing;
    };
    /// Writes the stored log into the new file. Where a limit, a purge or a deletion took messages away, the file is
    /// one from which their bytes were cut. `progress` is called with the bytes read and their total; if it returns
    /// false, fetch() ends with an error. Errors: no connection; nothing is stored there; the file cannot be written.
    static Result<Fetched> fetch(const std::string& address, const std::filesystem::path& file,
                                 const std::function<bool(std::uint64_t, std::uint64_t)>& progress = {});

    enum class Begin : std::uint8_t {
        fresh,    // an error if something is stored there
        replace,  // deletes the stored log once this one has a record
        goOn,     // writes the stored log into the file, and stores the records that are added later
    };
    /// Stores the records that are written to `file` from now on. The file need not exist yet; with `goOn` it exists
    /// afterwards. Errors: those of fetch(); no JetStream.
    static Result<std::unique_ptr<NatsLog>> start(const std::string& address, const std::filesystem::path& file,
                                                  Begin begin);
    /// Ends at once; records that are not stored yet are not stored.
    ~NatsLog();

    /// The address without secrets.
    const std::string& address() const;
    /// Of the log that goes on, when it was fetched.
    const Missing& missing() const;
    std::uint64_t storedBytes() const;
    /// The number of the last message.
    std::uint64_t storedMessages() const;
    /// Why nothing can be stored at present, or any more; empty if there is no fault.
    std::string failure() const;
    /// Waits until the whole file is stored. The writer must have closed it. Error: there was no progress for
    /// `patience`, or there can be none.
    Result<> finish(std::chrono::milliseconds patience = std::chrono::seconds(10));

  private:
    class Impl;
    explicit NatsLog(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
