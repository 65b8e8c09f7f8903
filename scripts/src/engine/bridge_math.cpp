// The elementary functions of Math. SpiderMonkey's own differ between its versions, C libraries and processors: sin,
// cos, tan and pow are the C library's, the others are compiled for the processor, with fused multiply-adds if it has
// them.
#include <rtsg/core/portable_math.h>

#include "bridge.h"

namespace rtsg::script {

namespace {

bool result(const JS::CallArgs& args, double number) {
    args.rval().setNumber(JS::CanonicalizeNaN(number));
    return true;
}

template <double (*F)(double)>
bool ofOne(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    double x = 0;
    return JS::ToNumber(cx, args.get(0), &x) && result(args, F(x));
}

template <double (*F)(double, double)>
bool ofTwo(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    double x = 0, y = 0;
    return JS::ToNumber(cx, args.get(0), &x) && JS::ToNumber(cx, args.get(1), &y) && result(args, F(x, y));
}

/// ECMA-262 (6.1.6.1.3) has NaN where ISO C has 1.
double power(double base, double exponent) {
    if (std::isnan(exponent) || (std::isinf(exponent) && std::abs(base) == 1)) return JS::GenericNaN();
    return portable::pow(base, exponent);
}

bool hypot(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    std::vector<double> components(args.length());
    for (unsigned i = 0; i < args.length(); ++i)
        if (!JS::ToNumber(cx, args[i], &components[i])) return false;
    return result(args, portable::hypot(components));
}

}  // namespace

bool addMathBridge(JSContext* cx, JS::HandleObject bridge) {
    static constexpr JSFunctionSpec functions[] = {
        JS_FN("acos", ofOne<portable::acos>, 1, 0),
        JS_FN("acosh", ofOne<portable::acosh>, 1, 0),
        JS_FN("asin", ofOne<portable::asin>, 1, 0),
        JS_FN("asinh", ofOne<portable::asinh>, 1, 0),
        JS_FN("atan", ofOne<portable::atan>, 1, 0),
        JS_FN("atan2", ofTwo<portable::atan2>, 2, 0),
        JS_FN("atanh", ofOne<portable::atanh>, 1, 0),
        JS_FN("cbrt", ofOne<portable::cbrt>, 1, 0),
        JS_FN("cos", ofOne<portable::cos>, 1, 0),
        JS_FN("cosh", ofOne<portable::cosh>, 1, 0),
        JS_FN("exp", ofOne<portable::exp>, 1, 0),
        JS_FN("expm1", ofOne<portable::expm1>, 1, 0),
        JS_FN("hypot", hypot, 2, 0),
        JS_FN("log", ofOne<portable::log>, 1, 0),
        JS_FN("log10", ofOne<portable::log10>, 1, 0),
        JS_FN("log1p", ofOne<portable::log1p>, 1, 0),
        JS_FN("log2", ofOne<portable::log2>, 1, 0),
        JS_FN("pow", ofTwo<power>, 2, 0),
        JS_FN("sin", ofOne<portable::sin>, 1, 0),
        JS_FN("sinh", ofOne<portable::sinh>, 1, 0),
        JS_FN("tan", ofOne<portable::tan>, 1, 0),
        JS_FN("tanh", ofOne<portable::tanh>, 1, 0),
        JS_FS_END,
    };
    JS::RootedObject math(cx, JS_NewPlainObject(cx));
    return math && JS_DefineFunctions(cx, math, functions) && JS_DefineProperty(cx, bridge, "math", math, 0);
}

}  // namespace rtsg::script
