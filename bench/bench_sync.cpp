// Runs all benches of sync.
#include "bench_sync.h"

#include "bench_sync_mirror.h"

namespace rtsg::bench {

bool sync(const SyncSizes& sizes, const Report& report) {
    bool ok = codec(sizes, report);
    ok = input(sizes, report) && ok;
    ok = mirrorThroughput(sizes, report) && ok;
    ok = mirrorLatency(sizes, report) && ok;
    ok = mirrorJoin(sizes, report) && ok;
    ok = mirrorResume(sizes, report) && ok;
    ok = mirrorPeers(sizes, report) && ok;
    ok = mirrorCrowd(sizes, report) && ok;
    ok = mirrorRegions(sizes, report) && ok;
    return log(sizes, report) && ok;
}

}  // namespace rtsg::bench
