// Reads for clients that do not look: one thread of the program for all of their connections.
//
// A client that makes a picture for seconds reads nothing meanwhile, and the system keeps some hundred kilobytes for
// it. What a server that ends has sent beyond these would be lost, and its goodbye with it. So whoever has been away
// for a while has its connection read into memory. Threading: any thread.
#pragma once

#include <condition_variable>
#include <mutex>
#include <set>
#include <thread>

namespace rtsg {

class ZmtpLink;

class LinkKeeper {
  public:
    static LinkKeeper& ofProgram();
    void add(ZmtpLink& link);
    /// When it returns nothing reads for the link any more.
    void remove(ZmtpLink& link);

  private:
    void run(const std::stop_token& stop);

    std::mutex mutex_;
    std::condition_variable_any wake_;
    std::set<ZmtpLink*> links_;
    std::jthread thread_;
};

}  // namespace rtsg
