// Custom field types: the form of their values, and the registry of those that this process knows.
#include <rtsg/core/custom_field.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <mutex>
#include <utility>

#include <rtsg/core/never_destroyed.h>

namespace rtsg {

namespace {

using Of = CustomLayout::Of;
constexpr std::size_t kLongestName = 64, kMaxNumbers = 1024;
thread_local bool numbersOnly = false;

bool isName(std::string_view name) {
    if (name.empty() || name.size() > kLongestName || name[0] < 'A' || name[0] > 'Z') return false;
    const bool isWord = std::ranges::all_of(name, [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
    });
    FieldType x3d{};
    return isWord && name != "Custom" && !fieldTypeFromName("SF" + std::string(name), x3d);
}

bool isPossible(const CustomLayout& layout) {
    return layout.of <= Of::float64 && layout.count <= kMaxNumbers && (layout.count > 0 || layout.of == Of::bytes);
}

std::string_view boxOf(const CustomValue& value) {
    return {value.box.data(), value.box.size()};
}

/// The length of the head; 0 if the box is malformed.
std::size_t headOf(std::string_view box, CustomLayout& layout) {
    constexpr std::size_t kNameAt = 4;
    if (box.size() < kNameAt) return 0;
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(box[i]); };
    const std::size_t end = kNameAt + byte(3);
    layout = {static_cast<Of>(byte(0)), static_cast<std::uint16_t>(byte(1) | byte(2) << 8)};
    if (box.size() < end || !isPossible(layout) || !isName(box.substr(kNameAt, byte(3)))) return 0;
    const std::size_t size = layout.size();
    return (size == 0 ? box.size() - end <= std::numeric_limits<std::uint32_t>::max() : box.size() - end == size) ? end
                                                                                                                  : 0;
}

CustomValue customValue(std::string_view head, std::string_view bits) {
    CustomValue value;
    value.box.reserve(head.size() + bits.size());
    value.box.append({head.data(), head.size()});
    value.box.append({bits.data(), bits.size()});
    return value;
}

template <class S>
void appendBits(std::string& bits, double number) {
    const S one = static_cast<S>(number);
    bits.append(reinterpret_cast<const char*>(&one), sizeof(one));
}

template <class S>
void appendNumbers(std::vector<double>& out, std::span<const std::byte> bits) {
    for (; bits.size() >= sizeof(S); bits = bits.subspan(sizeof(S))) {
        S one{};
        std::memcpy(&one, bits.data(), sizeof(one));
        out.push_back(static_cast<double>(one));
    }
}

template <class S>
std::string listed(std::span<const std::byte> bits) {
    std::string text;
    for (; bits.size() >= sizeof(S); bits = bits.subspan(sizeof(S))) {
        S one{};
        std::memcpy(&one, bits.data(), sizeof(one));
        char digits[40];
        const auto end = std::to_chars(digits, digits + sizeof(digits), one).ptr;
        if (!text.empty()) text += ' ';
        text.append(digits, end);
    }
    return text;
}

std::string counted(const CustomLayout& layout) {
    return std::to_string(layout.count) + (layout.of == Of::bytes ? " bytes" : " numbers");
}

}  // namespace

// ---- types and values ----------------------------------------------------------------------------------------------

Result<std::shared_ptr<const CustomType>> CustomType::make(std::string_view name, CustomLayout layout) {
    const bool isPrefixed = name.starts_with("SF") || name.starts_with("MF");
    const std::string_view bare = isPrefixed ? name.substr(2) : std::string_view();
    if (!isName(bare)) return fail("'" + std::string(name.substr(0, 80)) + "' cannot name a field type of one's own");
    if (!isPossible(layout)) return fail(std::string(name) + ": a value has 1 to 1024 numbers, or up to 1024 bytes");
    auto type = std::make_shared<CustomType>();
    type->layout_ = layout;
    type->head_ = {static_cast<char>(layout.of), static_cast<char>(layout.count & 255),
                   static_cast<char>(layout.count >> 8), static_cast<char>(bare.size())};
    type->head_ += bare;
    return type;
}

std::shared_ptr<const CustomType> CustomType::ofBox(std::string_view box) {
    CustomLayout layout;
    const std::size_t end = headOf(box, layout);
    if (end == 0) return nullptr;
    auto type = std::make_shared<CustomType>();
    type->layout_ = layout;
    type->head_ = box.substr(0, end);
    return type;
}

std::shared_ptr<const CustomType> CustomType::of(const CustomValue& value) {
    return ofBox(boxOf(value));
}

CustomValue CustomType::zero() const {
    return customValue(head_, std::string(layout_.size(), '\0'));
}

bool CustomType::holds(const CustomValue& value) const {
    const std::string_view box = boxOf(value);
    return box.starts_with(head_) && (layout_.size() == 0 || box.size() == head_.size() + layout_.size());
}

Result<CustomValue> CustomType::value(std::span<const std::byte> bits) const {
    if (layout_.size() != 0 && bits.size() != layout_.size())
        return fail("SF" + std::string(name()) + " consists of " + counted(layout_));
    return customValue(head_, {reinterpret_cast<const char*>(bits.data()), bits.size()});
}

Result<CustomValue> CustomType::value(std::span<const double> numbers) const {
    if (layout_.count != 0 && numbers.size() != layout_.count)
        return fail("SF" + std::string(name()) + " consists of " + counted(layout_) + ", not " +
                    std::to_string(numbers.size()));
    std::string bits;
    for (const double number : numbers) {
        const double minimum = layout_.of == Of::bytes ? 0 : std::numeric_limits<std::int32_t>::min();
        const double maximum = layout_.of == Of::bytes ? 255 : std::numeric_limits<std::int32_t>::max();
        const bool isInteger = number >= minimum && number <= maximum && number == std::trunc(number);
        if (layout_.of == Of::float64)
            appendBits<double>(bits, number);
        else if (layout_.of == Of::float32)
            appendBits<float>(bits, number);
        else if (!isInteger)
            return fail("SF" + std::string(name()) + " consists of " +
                        (layout_.of == Of::bytes ? "bytes, from 0 to 255" : "integers of 32 bits"));
        else if (layout_.of == Of::int32)
            appendBits<std::int32_t>(bits, number);
        else
            appendBits<std::uint8_t>(bits, number);
    }
    return customValue(head_, bits);
}

std::span<const std::byte> customBits(const CustomValue& value) {
    CustomLayout layout;
    const std::size_t end = headOf(boxOf(value), layout);
    if (end == 0) return {};
    return std::as_bytes(value.box.span()).subspan(end);
}

std::vector<double> customNumbers(const CustomValue& value) {
    CustomLayout layout;
    std::vector<double> numbers;
    if (headOf(boxOf(value), layout) == 0) return numbers;
    const std::span<const std::byte> bits = customBits(value);
    switch (layout.of) {
        case Of::bytes:
            appendNumbers<std::uint8_t>(numbers, bits);
            break;
        case Of::int32:
            appendNumbers<std::int32_t>(numbers, bits);
            break;
        case Of::float32:
            appendNumbers<float>(numbers, bits);
            break;
        case Of::float64:
            appendNumbers<double>(numbers, bits);
            break;
    }
    return numbers;
}

std::string customDefaultText(const CustomValue& value) {
    CustomLayout layout;
    headOf(boxOf(value), layout);
    const std::span<const std::byte> bits = customBits(value);
    if (layout.of == Of::int32) return listed<std::int32_t>(bits);
    if (layout.of == Of::float32) return listed<float>(bits);
    if (layout.of == Of::float64) return listed<double>(bits);
    constexpr char digits[] = "0123456789abcdef";
    std::string text = "0x";
    for (const std::byte byte : bits) {
        text += digits[std::to_integer<unsigned>(byte) >> 4];
        text += digits[std::to_integer<unsigned>(byte) & 15];
    }
    return text;
}

// ---- the registry --------------------------------------------------------------------------------------------------

class FieldTypeRegistry {
  public:
    struct Entry {
        std::shared_ptr<const CustomType> type;
        std::shared_ptr<const CustomFunctions> functions;
    };
    std::map<std::string, Entry, std::less<>> byName;  // "Quantity"
};

namespace {

struct Registered {
    std::mutex mutex;
    std::shared_ptr<const FieldTypeRegistry> now = std::make_shared<const FieldTypeRegistry>();
};

Registered& registered() {
    static const auto& all = neverDestroyed([] { return std::make_unique<Registered>(); });
    return *all;
}

/// Null if the type is not known here, or has another layout.
std::shared_ptr<const CustomFunctions> functionsOf(std::string_view head) {
    const auto all = fieldTypeRegistry();
    if (all->byName.empty() || head.size() < 4) return nullptr;
    const auto found = all->byName.find(head.substr(4));
    return found != all->byName.end() && found->second.type->head() == head ? found->second.functions : nullptr;
}

/// Null as above, and if the value is malformed.
std::shared_ptr<const CustomFunctions> functionsOf(const CustomValue& value) {
    CustomLayout layout;
    return functionsOf(boxOf(value).substr(0, headOf(boxOf(value), layout)));
}

/// Calls a function of the application for a type, and checks its result.
template <class Call>
Result<CustomValue> createdBy(const CustomType& type, const Call& call) {
    const std::string name = "SF" + std::string(type.name());
    try {
        Result<CustomValue> value = call();
        if (value && !type.holds(*value)) return fail(name + ": what its function makes is of another type");
        return value;
    } catch (const std::exception& e) {
        return fail(name + ": its function failed: " + e.what());
    } catch (...) {
        return fail(name + ": its function failed, and says not why");
    }
}

bool isNumber(std::string_view word) {
    if (word.starts_with('+') || word.starts_with('-')) word.remove_prefix(1);
    constexpr std::string_view kDigits = "0123456789abcdefABCDEF";
    if (word.starts_with("0x") || word.starts_with("0X"))
        return word.size() > 2 && word.find_first_not_of(kDigits, 2) == word.npos;
    double number = 0;
    const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), number);
    return end == word.data() + word.size() && code != std::errc::invalid_argument;
}

/// Whether the text may be read as a value without a text of its own: then it must not stand for other bits.
bool readsAsNumbers(std::string_view text, const CustomLayout& layout) {
    constexpr std::string_view kSpace = " ,\t\r\n";
    std::size_t count = 0;
    for (std::size_t at = text.find_first_not_of(kSpace); at < text.size(); at = text.find_first_not_of(kSpace, at)) {
        const std::size_t end = std::min(text.find_first_of(kSpace, at), text.size());
        const std::string_view word = text.substr(at, end - at);
        if (!isNumber(word) && word != "0x") return false;
        ++count;
        at = end;
    }
    return count == (layout.of == Of::bytes ? 1u : layout.count);
}

}  // namespace

std::shared_ptr<const FieldTypeRegistry> fieldTypeRegistry() {
    Registered& all = registered();
    const std::scoped_lock lock(all.mutex);
    return all.now;
}

void restoreFieldTypes(std::shared_ptr<const FieldTypeRegistry> before) {
    Registered& all = registered();
    const std::scoped_lock lock(all.mutex);
    all.now = std::move(before);
}

Result<std::shared_ptr<const CustomType>> registerFieldType(std::string_view name, CustomLayout layout,
                                                            CustomFunctions functions) {
    auto type = CustomType::make(name, layout);
    if (!type) return type;
    if (static_cast<bool>(functions.print) != static_cast<bool>(functions.parse))
        return fail(std::string(name) + ": a text needs both a function that prints it and one that reads it");
    const bool given = functions.print || functions.normalised || functions.between || functions.scriptsSeeText;
    Registered& all = registered();
    const std::scoped_lock lock(all.mutex);
    auto more = std::make_shared<FieldTypeRegistry>(*all.now);
    FieldTypeRegistry::Entry& entry = more->byName[std::string((*type)->name())];
    if (entry.type && !(*entry.type == **type))
        return fail("there is a field type " + std::string(name) + " already, which has another layout");
    if (!entry.type) entry.type = *type;
    if (given || !entry.functions) entry.functions = std::make_shared<const CustomFunctions>(std::move(functions));
    type = entry.type;
    all.now = std::move(more);
    return type;
}

namespace {

std::vector<std::shared_ptr<const CustomType>>& typesInScope() {
    static thread_local std::vector<std::shared_ptr<const CustomType>> types;
    return types;
}

}  // namespace

CustomNumbersOnly::CustomNumbersOnly() : outer_(std::exchange(numbersOnly, true)) {}

CustomNumbersOnly::~CustomNumbersOnly() {
    numbersOnly = outer_;
}

FieldTypesInScope::FieldTypesInScope(std::vector<std::shared_ptr<const CustomType>> types)
    : outer_(std::exchange(typesInScope(), std::move(types))) {}

FieldTypesInScope::~FieldTypesInScope() {
    typesInScope() = std::move(outer_);
}

std::shared_ptr<const CustomType> findFieldType(std::string_view name) {
    if (!name.starts_with("SF") && !name.starts_with("MF")) return nullptr;
    for (const auto& type : typesInScope())
        if (type->name() == name.substr(2)) return type;
    const auto all = fieldTypeRegistry();
    const auto found = all->byName.find(name.substr(2));
    return found == all->byName.end() ? nullptr : found->second.type;
}

bool fieldTypeFromName(std::string_view name, FieldType& type, std::shared_ptr<const CustomType>& custom) {
    custom = nullptr;
    if (fieldTypeFromName(name, type)) return true;
    custom = findFieldType(name);
    if (custom) type = name.starts_with('M') ? FieldType::MFCustom : FieldType::SFCustom;
    return custom != nullptr;
}

// ---- what types can do ---------------------------------------------------------------------------------------------

bool hasCustomText(const CustomType& type) {
    const auto functions = functionsOf(type.head());
    return functions && functions->parse;
}

bool scriptsSeeText(const CustomType& type) {
    const auto functions = functionsOf(type.head());
    return type.layout().of == Of::bytes || (functions && functions->scriptsSeeText);
}

Result<CustomValue> customFromText(const CustomType& type, std::string_view text) {
    const auto functions = functionsOf(type.head());
    if (!functions || !functions->parse) return fail("SF" + std::string(type.name()) + " has no text of its own here");
    auto value = createdBy(type, [&] { return functions->parse(type, text); });
    return value ? normalisedCustom(type, std::move(*value)) : value;
}

std::optional<std::string> customText(const CustomValue& value) {
    if (numbersOnly) return std::nullopt;
    const auto functions = functionsOf(value);
    if (!functions || !functions->print) return std::nullopt;
    const auto type = CustomType::of(value);
    try {
        std::string text = functions->print(value);
        if (readsAsNumbers(text, type->layout())) return std::nullopt;
        const auto back = customFromText(*type, text);
        if (back && *back == value) return text;
    } catch (...) {
        return std::nullopt;  // code of others; the numbers say the same
    }
    return std::nullopt;
}

Result<CustomValue> normalisedCustom(const CustomType& type, CustomValue value) {
    const auto functions = functionsOf(type.head());
    if (!functions || !functions->normalised) return value;
    return createdBy(type, [&] { return functions->normalised(type, value); });
}

CustomValue customBetween(const CustomValue& a, const CustomValue& b, double t) {
    const auto functions = functionsOf(a);
    const auto type = CustomType::of(a);
    if (!functions || !functions->between || !type->holds(b)) return a;
    const auto between = createdBy(*type, [&] { return Result<CustomValue>(functions->between(a, b, t)); });
    return between ? *between : a;
}

// ---- types of fields -----------------------------------------------------------------------------------------------

std::string fieldTypeName(FieldType type, const CustomType* custom) {
    if (!custom || sf(type) != FieldType::SFCustom) return std::string(info(type).name);
    return (isMF(type) ? "MF" : "SF") + std::string(custom->name());
}

std::string typeNameOf(const Value& value) {
    std::shared_ptr<const CustomType> custom;
    if (value.holds<CustomValue>()) custom = CustomType::of(value.as<CustomValue>());
    if (value.holds<Array<CustomValue>>() && !value.as<Array<CustomValue>>().empty())
        custom = CustomType::of(value.as<Array<CustomValue>>()[0]);
    return fieldTypeName(value.type(), custom.get());
}

Value zeroOf(FieldType type, const CustomType* custom) {
    return type == FieldType::SFCustom && custom ? Value(custom->zero()) : Value::zero(type);
}

bool detail::areOfType(const Value& value, const CustomType* custom) {
    if (!custom) return false;
    if (value.holds<CustomValue>()) return custom->holds(value.as<CustomValue>());
    return std::ranges::all_of(value.as<Array<CustomValue>>(),
                               [&](const CustomValue& one) { return custom->holds(one); });
}

}  // namespace rtsg
