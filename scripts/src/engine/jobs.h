// The work that a program has put off: the jobs of its promises, and the rejections that nobody has handled yet.
//
// SpiderMonkey hands jobs to this queue and never runs them by itself. A call into a program runs, before it ends,
// those that it has added, first in first out: a call nested in another one (a script that writes to another's field)
// leaves the outer call's jobs alone. Threading: the context's thread. Source: ECMA-262, 9.5 (jobs), 27.2.1.9
// (rejections).
#pragma once

#include "values.h"

namespace rtsg::script {

class Jobs final : public JS::JobQueue {
  public:
    /// The context gets its jobs from here; lives as long as the context.
    explicit Jobs(JSContext* cx);

    /// The present end of the lists of jobs and rejections: a call keeps it, and takes only later ones.
    struct Mark {
        std::size_t jobs, rejections;
    };
    Mark mark() const { return {jobs_.length(), rejected_.length()}; }

    /// The oldest job after the mark; null if none is left.
    JSObject* next(const Mark& mark, std::size_t& taken);
    /// The oldest promise after the mark that was rejected without anybody to handle it; null if none is left.
    JSObject* nextRejected(const Mark& mark, std::size_t& taken);
    /// Drops all that came after the mark.
    void endCall(const Mark& mark);

    JSObject* getIncumbentGlobal(JSContext* cx) override;
    bool enqueuePromiseJob(JSContext* cx, JS::HandleObject promise, JS::HandleObject job,
                           JS::HandleObject allocationSite, JS::HandleObject incumbentGlobal) override;
    void runJobs(JSContext*) override {}  // for debuggers alone
    bool empty() const override { return jobs_.empty(); }
    bool isDrainingStopped() const { return false; }  // virtual in SpiderMonkey 128, unknown in 102

  private:
    js::UniquePtr<SavedJobQueue> saveJobQueue(JSContext* cx) override;
    static void onRejection(JSContext* cx, bool muted, JS::HandleObject promise,
                            JS::PromiseRejectionHandlingState state, void* jobs);

    using Objects = JS::GCVector<JSObject*, 0, js::SystemAllocPolicy>;
    JS::PersistentRooted<Objects> jobs_, rejected_;  // null: done, or handled after all
};

}  // namespace rtsg::script
