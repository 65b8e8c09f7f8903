// Parses scripts only to find syntax errors.
#include "syntax.h"

#include "runtime.h"

namespace rtsg::script {

std::optional<SyntaxFault> syntaxFault(const std::string& source) {
    constexpr std::size_t heapLimit = std::size_t{256} << 20;
    const std::shared_ptr<Runtime> runtime = Runtime::ofThisThread(heapLimit);
    if (!runtime) return SyntaxFault{.text = Runtime::whyNone()};
    JSContext* const cx = runtime->context();
    const JSAutoRealm realm(cx, runtime->library());
    JS::CompileOptions options(cx);
    options.setFileAndLine("script", 1);
    JS::SourceText<mozilla::Utf8Unit> text;
    if (text.init(cx, source.data(), source.size(), JS::SourceOwnership::Borrowed)) {
        const RefPtr<JS::Stencil> stencil = JS::CompileGlobalScriptToStencil(cx, options, text);
        if (stencil) return {};
    }
    SyntaxFault fault{.text = "out of memory"};
    JS::ExceptionStack stack(cx);
    if (!JS_IsExceptionPending(cx) || !JS::StealPendingExceptionStack(cx, &stack)) return fault;
    JS::ErrorReportBuilder report(cx);
    if (!report.init(cx, stack, JS::ErrorReportBuilder::NoSideEffects)) {
        JS_ClearPendingException(cx);
        return fault;
    }
    fault.line = report.report()->lineno;
    if (report.toStringResult()) fault.text = report.toStringResult().c_str();
    return fault;
}

}  // namespace rtsg::script
