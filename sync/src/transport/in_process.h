// InProcess: a transport within this process, with endpoints inproc://NAME. Servers and clients that share one reach
// each other; nothing is encoded for a wire, and the bytes of a record are those of the server.
//
// Invariant: a message is there for its reader when send() returns. A connection is up while a listener has its name.
// Threading: any thread; a listener and a connection one after another. With a VirtualClock, all on its thread.
#pragma once

#include <memory>
#include <string>

#include "transport.h"

namespace rtsg {

class InProcess : public Transport {
  public:
    explicit InProcess(Clock& clock = steadyClock());
    ~InProcess() override;

    Clock& clock() override { return clock_; }
    Result<bool> isLocal(const std::string& endpoint) const override;
    /// Error: the name is taken. Nobody comes from outside, so who has keys is taken for their owner without a proof.
    Result<std::unique_ptr<Listener>> listen(const std::string& endpoint, const ListenSettings& settings) override;
    Result<std::unique_ptr<Connection>> connect(const std::string& endpoint, const ConnectSettings& settings) override;

  private:
    struct Directory;
    class Queue;
    class QueueListener;
    class QueueConnection;
    Clock& clock_;
    std::shared_ptr<Directory> directory_;
};

}  // namespace rtsg
