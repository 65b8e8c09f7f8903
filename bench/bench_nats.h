// Mirrors by way of NATS beside mirrors by ZeroMQ, bare NATS and a bare PUB socket, in one run.
#pragma once

#include "bench.h"
#include "bench_sync.h"

namespace rtsg::bench {

/// CPU time of a delivery (both ends, and the NATS server's), and milliseconds from newFrame() to each replica's
/// verified state, one frame at a time; the bare ones carry the same bytes. Measures nothing, and is true, where there
/// is no nats-server or this build has no NATS. Fails (false) if any replica state differs, or something does not
/// arrive.
bool natsCrowd(const SyncSizes& sizes, const Report& report);

}  // namespace rtsg::bench
