// The kind of the threads that ZeroMQ starts for a mirror, as sched(7) has them.
#include "transport/zmq_socket.h"

#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>
#include <zmq.h>

namespace rtsg {
namespace {

std::set<int> inputThreads() {
    std::set<int> result;
    for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
        std::string name;
        std::ifstream(task.path() / "comm") >> name;
        if (name.starts_with("ZMQbg/IO")) result.insert(std::stoi(task.path().filename()));
    }
    return result;
}

/// The kind of the one input thread that a context starts with its first socket; -1 if it starts another number.
int kindOfFreshThread() {
    const std::set<int> before = inputThreads();
    const ZmqContext context;
    const ZmqSocket socket(context, ZMQ_PAIR);
    int result = -1, found = 0;
    for (int attempt = 0; attempt < 1000 && found == 0; ++attempt) {  // it names itself, soon
        for (const int thread : inputThreads())
            if (!before.contains(thread)) {
                ++found;
                result = sched_getscheduler(thread);
            }
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return found == 1 ? result : -1;
}

TEST(ZmqSocket, ThreadsTakeTheirTurn) {
    int kind = 0;
    sched_param parameters{};
    ASSERT_EQ(pthread_getschedparam(pthread_self(), &kind, &parameters), 0);
    if (kind != SCHED_OTHER) GTEST_SKIP() << "this process is of kind " << kind;
    EXPECT_EQ(kindOfFreshThread(), SCHED_BATCH);
}

TEST(ZmqSocket, ThreadsOfARealTimeThreadStayWhatItIs) {
    int created = -1, kind = -1;
    std::thread([&] {
        const sched_param first{.sched_priority = 1};
        created = pthread_setschedparam(pthread_self(), SCHED_FIFO, &first);
        if (created == 0) kind = kindOfFreshThread();
    }).join();
    if (created != 0) GTEST_SKIP() << "real-time threads are not allowed here";
    EXPECT_EQ(kind, SCHED_FIFO);
}

}  // namespace
}  // namespace rtsg
