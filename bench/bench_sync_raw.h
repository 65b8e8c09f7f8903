// Raw ZeroMQ as the mirror's baseline: the same sockets (ROUTER to DEALER), the same parts and bytes, but nothing in
// them.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace rtsg::bench {

/// Bytes per second in messages of `size`, each in a buffer of its own that is written before and read after, with at
/// most `underway` of them not yet received; between two threads.
double rawThroughput(const std::string& endpoint, std::size_t size, int messages, int underway = 16);
/// Seconds until each of many had a frame, sorted, and the CPU time of it all for each of them.
struct Delays {
    std::vector<double> seconds;
    double cpuSeconds = 0;
};
/// From sending `size` bytes on a PUB socket to having received them, for each of `peers` SUB sockets with a
/// context and a thread of its own, in each of `messages`, one message at a time. Empty if not all arrived.
Delays rawPublishing(std::size_t size, int peers, int messages);
/// Microseconds from sending to having received `size` bytes, one message at a time, sorted.
std::vector<double> rawLatency(std::size_t size, int messages);

}  // namespace rtsg::bench
