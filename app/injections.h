// --set DEF.field=VALUE@TIME, --set DEVICE=WHAT@TIME: events that come into a scene from outside while it runs.
//
// Devices: pointer=[N:] [down|up] [X Y Z DX DY DZ | X Y [ASPECT] | leave], of a bearing in the world or a place in the
// picture from 0 (left, top) to 1, where what is left out is as pointer N had it; key=[down|up] NAME, both if neither
// is said; text=TEXT with \n for the end of a line; wheel=ACROSS DOWN; head=X Y Z AX AY AZ ANGLE.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include <rtsg/core/device_input.h>
#include <rtsg/documents/world.h>

#include "cli.h"

namespace rtsg::app {

class Injections {
  public:
    /// The scene must outlive this. Errors name what is wrong with one of `texts`.
    static Result<Injections> parse(Scene& scene, const std::vector<std::string>& texts);
    struct Injection {
        double time = 0;                // seconds
        std::string text, name, given;  // as it was typed; DEF.field and value of it, of a device none
        FieldRef target;
        Value value;
        bool isNow = false;  // the value is the scene's time when it is sent
    };
    /// The next one that is due at `t`, each once; null when none is. Its target is the node that has the name now,
    /// since another world may have come. If no suitable node has it, the target is still the one that had the name
    /// when it was parsed.
    const Injection* next(double t);
    /// Error: names the first that is due only after `end`, seconds.
    Result<> checkWithin(double end) const;
    /// The first whose field takes events only, devices' included; null if none does.
    const Injection* findInput() const;
    /// The first that has not been due; null if each has.
    const Injection* waiting() const { return next_ == all_.size() ? nullptr : &all_[next_]; }
    /// Queues those that are due for the frame at `t`, which is `start` later on the scene's clock. Events that the
    /// scene refuses are reported on standard error, and the program ends with kBad.
    void sendUntil(double t, double start);

  private:
    Result<> parseOne(const std::string& text, const std::string& name, const std::string& given, double time);
    Result<Injection> toField(const std::string& text, const std::string& name, const std::string& given,
                              double time) const;
    Result<> parseDevice(const std::string& name, const std::string& given, double time);
    Result<> parsePointer(const std::vector<std::string>& words, double time);
    Result<> parseKey(const std::vector<std::string>& words, double time);
    void add(FieldIndex field, Value value, double time);

    std::map<std::int32_t, PointerInput> pointers_;  // as the last event left them
    std::set<std::int32_t> pointed_;                 // those that have been told of
    Scene* scene_ = nullptr;
    std::vector<Injection> all_;
    std::size_t next_ = 0;
};

}  // namespace rtsg::app
