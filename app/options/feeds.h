// --feed, --publish and --foxglove: events from outside for a running scene, and the values that it publishes.
//
// Threading: the scene's thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/feeds/feed.h>
#include <rtsg/feeds/publisher.h>
#include <rtsg/session/foxglove.h>
#include <rtsg/session/health.h>

#include "command.h"
#include "viewer_arguments.h"

namespace rtsg::app {

struct FeedArguments {
    std::vector<std::string> feeds, targets, fields;
    double rate = 0;
    FoxgloveArguments foxglove;

    void addTo(Command& command);
    /// Throws UsageError for options that make no sense together, or with the scene's file. `timed`: the scene runs in
    /// simulated time, so feeds are pipes and files.
    void check(const std::string& scene, bool timed) const;
};

/// The feeds and publishers of a verb.
class Feeds {
  public:
    struct Settings {
        double start = 0;       // of times, on the scene's clock
        bool timed = false;     // events wait for their times, and the scene for lines
        bool insecure = false;  // addresses that others reach are allowed
        int call = -1;          // eventfd, written when something has come
    };
    /// `arguments` must be checked.
    static Result<Feeds> start(const FeedArguments& arguments, WorldOnDemand& world, const Settings& settings);

    /// Before the frame at `t`, and after it; seconds since the start. Diagnostics are printed.
    void before(double t);
    void after(double t);
    /// When the next event or value that waits is due; infinity if there is none.
    double nextAt() const;
    /// The counts of each feed, by its position.
    std::vector<EndpointCounts> counts() const;
    bool any() const { return !feeds_.empty() || !publishers_.empty() || !foxglove_.address().empty(); }
    /// Says on standard error what is open, and where. Returns
    /// `,"feeds":["…"],"published":["…"],"foxglove":"…"`.
    std::string sayEndpoints() const;
    /// The end: says what was left out. Lines of the user's own pipe or file that were faulty make the status 1.
    void end();
    /// `,"feeds":[…],"published":[…],"foxglove":{…}`; empty if there are none.
    std::string json() const;

  private:
    void printNews();

    std::vector<std::unique_ptr<Feed>> feeds_;
    std::vector<std::unique_ptr<Publisher>> publishers_;
    Foxglove foxglove_;
    std::string viewers_;  // what it had counted at the end, as JSON
};

}  // namespace rtsg::app
