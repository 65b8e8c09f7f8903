// The queue of promise jobs of one context, and the list of promises that were rejected with nobody listening.
#include "jobs.h"

namespace rtsg::script {

Jobs::Jobs(JSContext* cx) : jobs_(cx), rejected_(cx) {
    JS::SetJobQueue(cx, this);
    JS::SetPromiseRejectionTrackerCallback(cx, onRejection, this);
}

namespace {

template <class Objects>
JSObject* takeNext(Objects& objects, std::size_t first, std::size_t& taken) {
    while (first + taken < objects.length())
        if (JSObject* object = objects[first + taken++].get()) {
            objects[first + taken - 1].set(nullptr);
            return object;
        }
    return nullptr;
}

}  // namespace

JSObject* Jobs::next(const Mark& mark, std::size_t& taken) {
    JSObject* job = takeNext(jobs_, mark.jobs, taken);
    // A long chain has one job waiting at a time: drops those that are done.
    if (mark.jobs + taken == jobs_.length()) {
        jobs_.shrinkBy(jobs_.length() - mark.jobs);
        taken = 0;
    }
    return job;
}

JSObject* Jobs::nextRejected(const Mark& mark, std::size_t& taken) {
    return takeNext(rejected_, mark.rejections, taken);
}

void Jobs::endCall(const Mark& mark) {
    if (jobs_.length() > mark.jobs) jobs_.shrinkBy(jobs_.length() - mark.jobs);
    if (rejected_.length() > mark.rejections) rejected_.shrinkBy(rejected_.length() - mark.rejections);
}

JSObject* Jobs::getIncumbentGlobal(JSContext* cx) {
    return JS::CurrentGlobalOrNull(cx);
}

bool Jobs::enqueuePromiseJob(JSContext* cx, JS::HandleObject, JS::HandleObject job, JS::HandleObject,
                             JS::HandleObject) {
    if (jobs_.append(job)) return true;
    JS_ReportOutOfMemory(cx);
    return false;
}

js::UniquePtr<JS::JobQueue::SavedJobQueue> Jobs::saveJobQueue(JSContext* cx) {
    JS_ReportOutOfMemory(cx);  // asked for by debuggers alone, and there is none
    return nullptr;
}

void Jobs::onRejection(JSContext*, bool, JS::HandleObject promise, JS::PromiseRejectionHandlingState state,
                       void* jobs) {
    auto& rejected = static_cast<Jobs*>(jobs)->rejected_;
    if (state == JS::PromiseRejectionHandlingState::Unhandled) {
        (void)rejected.append(promise);  // without memory for the note, the program is being stopped anyway
        return;
    }
    for (std::size_t i = 0; i < rejected.length(); ++i)
        if (rejected[i].get() == promise) rejected[i].set(nullptr);
}

}  // namespace rtsg::script
