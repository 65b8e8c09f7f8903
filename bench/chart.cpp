// Draws charts of error against time as SVG, and writes them as CSV.
#include "chart.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/output_file.h>

namespace rtsg::bench {

namespace {

/// Told apart by readers with any kind of colour vision (Okabe and Ito), and black.
constexpr std::array kColours = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#222222"};
constexpr const char* kGrey = "#777777";

constexpr double kWidth = 860, kTextHeight = 13, kTop = 30, kLabelGap = 15;

/// Width of text in px, near enough for a layout: a proportional sans-serif font has about half its size a letter.
double widthOf(const std::string& text, double size = kTextHeight) {
    std::size_t letters = 0;
    for (const char c : text) letters += (static_cast<unsigned char>(c) & 0xC0) != 0x80;
    return static_cast<double>(letters) * size * .53;
}

/// 1 2 000 30 000 10⁵; decimals as few as needed.
std::string figure(double value) {
    const double size = std::abs(value);
    if (size == 0) return "0";
    const double exponent = std::floor(std::log10(size) + 1e-9);
    if (exponent < -3 || exponent > 4) {
        static constexpr std::array digits = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
        const double mantissa = value / std::pow(10, exponent);
        std::string out = std::abs(mantissa - 1) < 1e-6 ? "10" : fmt::format("{:.3g}·10", mantissa);
        if (exponent < 0) out += "⁻";
        for (const char c : fmt::format("{}", static_cast<int>(std::abs(exponent)))) out += digits.at(c - '0');
        return out;
    }
    std::string out = fmt::format("{:.4g}", value);
    if (size >= 1000) out = fmt::format("{:.0f}", value), out.insert(out.size() - 3, ",");
    return out;
}

/// A range of values laid over a range of pixels.
class Scale {
  public:
    Scale(const Axis& axis, std::vector<double> values) : axis_(axis) {
        std::erase_if(values, [&](double v) { return !shows(v); });
        if (values.empty()) values = {1, 10};
        const auto [minimum, maximum] = std::ranges::minmax(values);
        low_ = minimum, high_ = maximum;
        if (axis.logarithmic) {
            spreadDecades();
        } else {
            if (axis.fromZero && low_ > 0) low_ = 0;
            if (high_ <= low_) high_ = low_ + std::max(1.0, std::abs(low_));
            spreadSteps();
        }
    }
    void setRange(double first, double last) { first_ = first, last_ = last; }

    bool shows(double v) const { return std::isfinite(v) && (!axis_.logarithmic || v > 0); }
    double operator()(double v) const {
        const double fraction = axis_.logarithmic ? (std::log(v) - std::log(low_)) / (std::log(high_) - std::log(low_))
                                                  : (v - low_) / (high_ - low_);
        return first_ + fraction * (last_ - first_);
    }
    const std::vector<double>& ticks() const { return ticks_; }

  private:
    void spreadDecades() {
        const double decades = std::log10(high_) - std::log10(low_);
        const std::vector<double> steps = decades > 3.5   ? std::vector<double>{1}
                                          : decades > 1.2 ? std::vector<double>{1, 3}
                                                          : std::vector<double>{1, 2, 3, 5, 7};
        std::vector<double> marks;
        for (double e = std::floor(std::log10(low_)) - 1; e <= std::ceil(std::log10(high_)) + 1; ++e)
            for (const double s : steps) marks.push_back(s * std::pow(10, e));
        // From the last mark at or below the least value to the first at or above the greatest.
        auto first = std::ranges::upper_bound(marks, low_ * 1.02) - 1;
        auto last = std::ranges::lower_bound(marks, high_ * .98);
        if (first == last) ++last;
        low_ = *first, high_ = *last;
        const auto every = std::max<std::ptrdiff_t>(1, (last - first + 8) / 9);
        for (auto mark = first; mark <= last; mark += std::min(every, last - mark + 1)) ticks_.push_back(*mark);
    }
    void spreadSteps() {
        const double raw = (high_ - low_) / 6, power = std::pow(10, std::floor(std::log10(raw)));
        double step = 10 * power;
        for (const double s : {1.0, 2.0, 2.5, 5.0})
            if (raw <= s * power * (1 + 1e-9)) {
                step = s * power;
                break;
            }
        low_ = std::floor(low_ / step + 1e-9) * step;
        high_ = std::ceil(high_ / step - 1e-9) * step;
        for (double v = low_; v <= high_ + step / 2; v += step) ticks_.push_back(std::abs(v) < step * 1e-9 ? 0 : v);
    }

    Axis axis_;
    double low_ = 0, high_ = 1, first_ = 0, last_ = 1;
    std::vector<double> ticks_;
};

std::vector<double> valuesOf(const Chart& chart, double ChartPoint::* coordinate) {
    std::vector<double> out;
    for (const Series& s : chart.series)
        for (const ChartPoint& p : s.points) out.push_back(p.*coordinate);
    return out;
}

/// Lines of at most `width` px.
std::vector<std::string> wrapped(const std::string& text, double width) {
    std::vector<std::string> lines(1);
    std::string word;
    const auto flush = [&] {
        if (!lines.back().empty() && widthOf(lines.back() + " " + word, 12) > width) lines.emplace_back();
        if (!word.empty()) lines.back() += (lines.back().empty() ? "" : " ") + word;
        word.clear();
    };
    for (const char c : text)
        if (c == ' ')
            flush();
        else
            word += c;
    flush();
    return lines;
}

class Drawing {
  public:
    explicit Drawing(const Chart& chart)
        : chart_(chart), x_(chart.x, valuesOf(chart, &ChartPoint::x)), y_(chart.y, valuesOf(chart, &ChartPoint::y)) {}

    std::string svg() {
        head();
        chart_.rows.empty() ? lines() : rows();
        return fmt::format(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:g} {1:g}\" width=\"{0:g}\" height=\"{1:g}\" "
            "font-family=\"Helvetica, Arial, 'Liberation Sans', sans-serif\" font-size=\"{2:g}\">\n"
            "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{3}</svg>\n",
            kWidth, height_, kTextHeight, body_);
    }

  private:
    struct EndLabel {
        std::string text, colour;
        double x, y, wanted;
    };

    template <class... T>
    void add(fmt::format_string<T...> format, T&&... values) {
        body_ += fmt::format(format, std::forward<T>(values)...);
        body_ += '\n';
    }
    void text(double x, double y, const std::string& anchor, const std::string& colour, const std::string& words,
              const std::string& more = {}) {
        add("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" fill=\"{}\" {}>{}</text>", x, y, anchor, colour, more,
            escapeMarkup(words));
    }
    void line(double x1, double y1, double x2, double y2, const std::string& colour, double width = 1) {
        add("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" stroke-width=\"{:g}\"/>", x1,
            y1, x2, y2, colour, width);
    }
    void mark(double x, double y, std::size_t shape, const std::string& colour) {
        if (shape % 3 == 0)
            add("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"/>", x, y, colour);
        else if (shape % 3 == 1)
            add("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"7\" height=\"7\" fill=\"{}\"/>", x - 3.5, y - 3.5, colour);
        else
            add("<path d=\"M{:.1f} {:.1f}l4.8 8.4h-9.6z\" fill=\"{}\"/>", x, y - 5.2, colour);
    }
    std::string colourOf(std::size_t series) const {
        return chart_.series[series].reference ? kGrey : kColours.at(series % kColours.size());
    }

    void head() {
        text(20, kTop, "start", "#111111", chart_.title, "font-size=\"17\" font-weight=\"bold\"");
        top_ = kTop + 8;
        if (!chart_.note.empty())
            for (const std::string& words : wrapped(chart_.note, kWidth - 40)) {
                top_ += 15;
                text(20, top_, "start", "#555555", words, "font-size=\"12\"");
            }
        top_ += 22;
    }

    void xAxis(double bottom) {
        double free = -1e9;
        for (const double v : x_.ticks()) {
            line(x_(v), top_, x_(v), bottom, "#e6e6e6");
            const std::string words = figure(v);
            if (x_(v) - widthOf(words) / 2 < free) continue;
            text(x_(v), bottom + 18, "middle", "#444444", words);
            free = x_(v) + widthOf(words) / 2 + 8;
        }
        text((left_ + right_) / 2, bottom + 40, "middle", "#222222", chart_.x.label);
        height_ = bottom + 54;
    }

    void lines() {
        double widest = 0;
        for (const Series& s : chart_.series) widest = std::max(widest, widthOf(s.name));
        double ticks = 0;
        for (const double v : y_.ticks()) ticks = std::max(ticks, widthOf(figure(v)));
        left_ = 44 + ticks, right_ = kWidth - std::min(320.0, widest) - 46;
        const double bottom = top_ + 360;
        x_.setRange(left_, right_), y_.setRange(bottom, top_);
        xAxis(bottom);
        for (const double v : y_.ticks()) {
            line(left_, y_(v), right_, y_(v), "#e6e6e6");
            text(left_ - 8, y_(v) + 4.5, "end", "#444444", figure(v));
        }
        text(20, (top_ + bottom) / 2, "middle", "#222222", chart_.y.label,
             fmt::format("transform=\"rotate(-90 20 {:.1f})\"", (top_ + bottom) / 2));
        line(left_, bottom, right_, bottom, "#888888");
        std::vector<EndLabel> labels;
        for (std::size_t i = 0; i < chart_.series.size(); ++i)
            if (const auto end = curve(i))
                labels.push_back({chart_.series[i].name, colourOf(i), end->first, end->second, end->second});
        write(labels, bottom);
    }

    /// Draws a series; where its name belongs, if anything of it shows.
    std::optional<std::pair<double, double>> curve(std::size_t index) {
        const Series& s = chart_.series[index];
        const std::string colour = colourOf(index);
        std::string path;
        std::vector<const ChartPoint*> shown;
        for (const ChartPoint& p : s.points)
            if (x_.shows(p.x) && y_.shows(p.y)) shown.push_back(&p);
        if (shown.empty()) return std::nullopt;
        const ChartPoint* last = shown.front();
        for (const ChartPoint* p : shown) {
            path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x_(p->x), y_(p->y));
            if (p->x >= last->x) last = p;
        }
        if (!s.scattered)
            add("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"{}/>", path, colour,
                s.reference ? 1.2 : 2, s.reference ? " stroke-dasharray=\"5 4\"" : "");
        for (const ChartPoint* p : shown) {
            if (!s.reference && shown.size() <= 60) mark(x_(p->x), y_(p->y), index, colour);
            if (!p->label.empty())
                text(x_(p->x) + 7, y_(p->y) - 6, "start", colour, p->label,
                     "font-size=\"11\" paint-order=\"stroke\" stroke=\"white\" stroke-width=\"3\"");
        }
        return std::pair{x_(last->x), y_(last->y)};
    }

    /// The names of the series to the right of the plot, at the height of their ends as far as they do not collide.
    void write(std::vector<EndLabel>& labels, double bottom) {
        std::ranges::sort(labels, {}, &EndLabel::wanted);
        for (std::size_t i = 1; i < labels.size(); ++i)
            labels[i].y = std::max(labels[i].y, labels[i - 1].y + kLabelGap);
        if (!labels.empty()) labels.back().y = std::min(labels.back().y, bottom);
        for (std::size_t i = labels.size(); i-- > 1;)
            labels[i - 1].y = std::min(labels[i - 1].y, labels[i].y - kLabelGap);
        for (const EndLabel& l : labels) {
            line(l.x + 6, l.wanted, right_ + 22, l.y, l.colour, .6);
            text(right_ + 26, l.y + 4.5, "start", l.colour, l.text);
        }
    }

    void rows() {
        double widest = 0;
        for (const std::string& row : chart_.rows) widest = std::max(widest, widthOf(row));
        left_ = 36 + widest, right_ = kWidth - 40;
        // The legend above: a mark and a name each.
        double x = left_;
        for (std::size_t i = 0; i < chart_.series.size(); ++i) {
            const double width = widthOf(chart_.series[i].name) + 30;
            if (x + width > kWidth - 10 && x > left_) x = left_, top_ += 18;
            mark(x + 5, top_ - 4.5, i, colourOf(i));
            text(x + 14, top_, "start", colourOf(i), chart_.series[i].name);
            x += width;
        }
        top_ += 14;
        const double gap = 30, bottom = top_ + gap * static_cast<double>(chart_.rows.size());
        x_.setRange(left_, right_);
        xAxis(bottom);
        const auto height = [&](double row) { return top_ + gap * (row + .5); };
        for (std::size_t r = 0; r < chart_.rows.size(); ++r) {
            const double y = height(static_cast<double>(r));
            double low = std::numeric_limits<double>::infinity(), high = -low;
            for (const Series& s : chart_.series)
                for (const ChartPoint& p : s.points)
                    if (p.y == static_cast<double>(r) && x_.shows(p.x))
                        low = std::min(low, p.x), high = std::max(high, p.x);
            if (low < high) line(x_(low), y, x_(high), y, "#cccccc", 2);
            text(left_ - 12, y + 4.5, "end", "#222222", chart_.rows[r]);
        }
        // A little below one another, and the first on top, so that equal values can be told apart.
        const double apart = std::min(4.0, 20.0 / static_cast<double>(chart_.series.size()));
        for (std::size_t i = chart_.series.size(); i-- > 0;)
            for (const ChartPoint& p : chart_.series[i].points)
                if (x_.shows(p.x))
                    mark(x_(p.x),
                         height(p.y) +
                             apart * (static_cast<double>(i) - static_cast<double>(chart_.series.size() - 1) / 2),
                         i, colourOf(i));
    }

    const Chart& chart_;
    Scale x_, y_;
    std::string body_;
    double top_ = 0, left_ = 0, right_ = 0, height_ = 0;
};

std::string quoted(const std::string& text) {
    if (text.find_first_of(",\"\n") == std::string::npos) return text;
    std::string out = "\"";
    for (const char c : text) out += c == '"' ? "\"\"" : std::string(1, c);
    return out + '"';
}

}  // namespace

std::string svgOf(const Chart& chart) {
    return Drawing(chart).svg();
}

std::string csvOf(const Chart& chart) {
    std::string out = fmt::format("series,{},{},label\n", quoted(chart.rows.empty() ? chart.x.label : "row"),
                                  quoted(chart.rows.empty() ? chart.y.label : chart.x.label));
    for (const Series& s : chart.series)
        for (const ChartPoint& p : s.points)
            if (const auto row = static_cast<std::size_t>(p.y); !chart.rows.empty())
                out +=
                    fmt::format("{},{},{:.6g},{}\n", quoted(s.name), quoted(chart.rows.at(row)), p.x, quoted(p.label));
            else
                out += fmt::format("{},{:.6g},{:.6g},{}\n", quoted(s.name), p.x, p.y, quoted(p.label));
    return out;
}

Result<> writeChart(const Chart& chart, const std::filesystem::path& folder) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    for (const auto& [ending, content] : {std::pair{".svg", svgOf(chart)}, std::pair{".csv", csvOf(chart)}})
        if (auto ok = writeWholeFile(folder / (chart.name + ending), std::as_bytes(std::span(content))); !ok) return ok;
    return chart.beside ? chart.beside(folder) : Result<>();
}

}  // namespace rtsg::bench
