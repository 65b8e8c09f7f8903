// --set DEF.field=VALUE@TIME and --set DEVICE=WHAT@TIME: events that enter a scene from outside while it runs.
//
// Devices: pointer=[N:] [down|up] [X Y Z DX DY DZ | X Y [ASPECT] | leave], with a bearing in the world, or a place in
// the picture from 0 (left, top) to 1; omitted values are as pointer N last had them. key=[down|up] NAME, by default
// both. text=TEXT with \n for the end of a line. wheel=ACROSS DOWN. head=X Y Z AX AY AZ ANGLE.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include <rtsg/core/device_input.h>
#include <rtsg/documents/world.h>
#include <rtsg/session/notices.h>

namespace rtsg {

class Injections {
  public:
    /// The scene must outlive this. Errors say what is wrong with one of `texts`.
    static Result<Injections> parse(Scene& scene, const std::vector<std::string>& texts);
    struct Injection {
        double time = 0;                // seconds
        std::string text, name, given;  // as typed; then DEF.field and its value, empty for a device
        FieldRef target;
        Value value;
        bool isNow = false;  // the value is the scene's time when it is sent
    };
    /// The next one that is due at `t`; each is returned once. Null if none is. Its target is the node that has the
    /// name now, since another world may have been loaded. If no suitable node has the name, it is the node that had it
    /// when parsed.
    const Injection* next(double t);
    /// Error: names the first one that is due after `end`, in seconds.
    Result<> checkWithin(double end) const;
    /// The first one whose field only takes events, with those of devices. Null if none does.
    const Injection* findInput() const;
    /// The first one that has not been due yet. Null if each has.
    const Injection* waiting() const { return next_ == all_.size() ? nullptr : &all_[next_]; }
    /// Queues those that are due for the frame at `t`, which is `start` later on the scene's clock. Refused events are
    /// reported, and left out.
    void sendUntil(double t, double start, const SessionContext& context);

  private:
    Result<> parseOne(const std::string& text, const std::string& name, const std::string& given, double time);
    Result<Injection> toField(const std::string& text, const std::string& name, const std::string& given,
                              double time) const;
    Result<> parseDevice(const std::string& name, const std::string& given, double time);
    Result<> parsePointer(const std::vector<std::string>& words, double time);
    Result<> parseKey(const std::vector<std::string>& words, double time);
    void add(FieldIndex field, Value value, double time);

    std::map<std::int32_t, PointerInput> pointers_;  // after the last event of each
    std::set<std::int32_t> pointed_;                 // pointers that have been announced
    Scene* scene_ = nullptr;
    std::vector<Injection> all_;
    std::size_t next_ = 0;
};

}  // namespace rtsg
