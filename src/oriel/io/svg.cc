#include <algorithm>
#include <array>
#include <cmath>

#include "oriel/io/drawing.h"
#include "oriel/io/text.h"

namespace oriel {
namespace {

constexpr double kPanel = 600, kMargin = 24, kTitle = 44, kFoot = 36;  // [px]
constexpr std::size_t kMostDrawn = 20000;                              // marks of one kind in a panel

struct View {
  int across = 0, up = 1;  // axes of the world
};

bool finite(const Vec3d& p) { return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]); }

// Between the quantiles of one coordinate: a few points far away must not shrink the rest to a dot.
std::pair<double, double> range_of(const std::vector<Vec3d>& places, int axis, double cut) {
  std::vector<double> values;
  for (const Vec3d& p : places)
    if (finite(p)) values.push_back(p[axis]);
  if (values.empty()) return {0, 0};
  const auto at = [&](double q) {
    const auto n = static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), values.begin() + n, values.end());
    return values[static_cast<std::size_t>(n)];
  };
  return {at(cut), at(1 - cut)};
}

// Poses whole, landmarks without the outermost 2 % at either end.
std::pair<double, double> extent(const Drawing& d, int axis) {
  auto range = range_of(d.poses, axis, 0.0);
  if (d.landmarks.empty()) return range;
  const auto wide = range_of(d.landmarks, axis, 0.02);
  return {std::min(range.first, wide.first), std::max(range.second, wide.second)};
}

// The two axes along which it is widest, in their own order; x and y where it has no height.
View widest_view(const Drawing& d) {
  std::array<double, 3> width;
  for (int i = 0; i < 3; ++i) width[static_cast<std::size_t>(i)] = extent(d, i).second - extent(d, i).first;
  const auto least = static_cast<int>(std::min_element(width.rbegin(), width.rend()) - width.rbegin());
  if (least == 0) return {0, 1};
  return least == 1 ? View{0, 2} : View{1, 2};
}

class Panel {
 public:
  Panel(std::string& out, const Drawing& d, View view, double left) : out_(out), d_(d), view_(view), left_(left) {
    const auto [x0, x1] = extent(d, view.across);
    const auto [y0, y1] = extent(d, view.up);
    const double wide = std::max({x1 - x0, y1 - y0, 1e-9});
    scale_ = (kPanel - 2 * kMargin) / wide;
    centre_ = {{0.5 * (x0 + x1), 0.5 * (y0 + y1)}};
  }

  void draw(const char* name, const char* clip) {
    text(left_ + kPanel / 2, kTitle - 8, "middle", name);
    out_ += "<g clip-path=\"url(#";
    out_ += clip;
    out_ += ")\">\n";
    std::string note = dots(d_.landmarks, "#c87814", 1.6, "landmarks");
    note += lines(d_.loops, "#999", "0.7", "loop edges");
    if (d_.path.empty())
      note += dots(d_.poses, "#1e50c8", 2.2, "poses");
    else
      lines(d_.path, "#1e50c8", "1.3", nullptr);
    out_ += "</g>\n";
    foot(note);
  }

 private:
  double x(const Vec3d& p) const { return left_ + kPanel / 2 + scale_ * (p[view_.across] - centre_[0]); }
  double y(const Vec3d& p) const { return kTitle + kPanel / 2 - scale_ * (p[view_.up] - centre_[1]); }

  void number(double value) {  // a tenth of a pixel; far outside the picture all is alike
    append_number(out_, std::round(10 * std::clamp(value, -99999.0, 99999.0)) / 10);
  }
  void text(double at_x, double at_y, const char* anchor, const std::string& words) {
    out_ += "<text x=\"";
    number(at_x);
    out_ += "\" y=\"";
    number(at_y);
    out_ += std::string("\" text-anchor=\"") + anchor + "\">" + words + "</text>\n";
  }

  static std::string thinned(std::size_t count, std::size_t stride, const char* what) {
    if (stride == 1 || what == nullptr) return "";
    return "one in " + std::to_string(stride) + " of " + std::to_string(count) + " " + what + "; ";
  }

  std::string dots(const std::vector<Vec3d>& places, const char* colour, double radius, const char* what) {
    if (places.empty()) return "";
    const std::size_t stride = (places.size() + kMostDrawn - 1) / kMostDrawn;
    // A line of no length with round ends is a dot, in a fifth of a circle's bytes.
    out_ += std::string("<path fill=\"none\" stroke-linecap=\"round\" stroke=\"") + colour + "\" stroke-width=\"";
    number(2 * radius);
    out_ += "\" d=\"";
    for (std::size_t i = 0; i < places.size(); i += stride)
      if (finite(places[i])) {
        move('M', places[i]);
        out_ += "h0";
      }
    out_ += "\"/>\n";
    return thinned(places.size(), stride, what);
  }

  void move(char command, const Vec3d& p) {
    out_ += command;
    number(x(p));
    out_ += ' ';
    number(y(p));
  }

  // All of the path, every n-th of the loops.
  std::string lines(const std::vector<Drawing::Line>& list, const char* colour, const char* width, const char* what) {
    if (list.empty()) return "";
    const std::size_t stride = what == nullptr ? 1 : (list.size() + kMostDrawn - 1) / kMostDrawn;
    out_ += std::string("<path fill=\"none\" stroke=\"") + colour + "\" stroke-width=\"" + width + "\" d=\"";
    std::int32_t at = -1;
    for (std::size_t k = 0; k < list.size(); k += stride) {
      const Vec3d &a = d_.poses[static_cast<std::size_t>(list[k].first)],
                  &b = d_.poses[static_cast<std::size_t>(list[k].second)];
      if (!finite(a) || !finite(b)) continue;
      if (list[k].first != at) move('M', a);
      move('L', b);
      at = list[k].second;
    }
    out_ += "\"/>\n";
    return thinned(list.size(), stride, what);
  }

  // A bar of a round length [m], of a fifth to a half of the panel.
  void foot(const std::string& note) {
    const double most = 0.5 * kPanel / scale_;
    double length = std::pow(10.0, std::floor(std::log10(most)));
    for (const double more : {5.0, 2.0})
      if (length * more <= most) {
        length *= more;
        break;
      }
    const double bottom = kTitle + kPanel + 14;
    out_ += "<path stroke=\"#333\" stroke-width=\"2\" d=\"M";
    number(left_ + kMargin);
    out_ += ' ';
    number(bottom);
    out_ += 'h';
    number(length * scale_);
    out_ += "\"/>\n";
    std::string words;
    append_number(words, length);
    text(left_ + kMargin, bottom + 16, "start", words + " m");
    static constexpr char kAxes[] = "xyz";
    text(left_ + kPanel - kMargin, bottom + 16, "end",
         note + kAxes[view_.across] + " to the right, " + kAxes[view_.up] + " up");
  }

  std::string& out_;
  const Drawing& d_;
  View view_;
  double left_, scale_ = 1;
  Vec2d centre_{};
};

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else
      out += c >= ' ' && c <= '~' ? c : '?';
  }
  return out;
}

}  // namespace

std::string format_svg(const std::string& title, const Drawing& before, const Drawing& after) {
  const double width = 2 * kPanel, height = kTitle + kPanel + kFoot;
  std::string out = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 ";
  append_number(out, width);
  out += ' ';
  append_number(out, height);
  out += "\" font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  for (const int panel : {0, 1}) {
    out += "<clipPath id=\"p" + std::to_string(panel) + "\"><rect x=\"";
    append_number(out, panel * kPanel);
    out += "\" y=\"44\" width=\"600\" height=\"600\"/></clipPath>\n";
  }
  out += "<text x=\"600\" y=\"18\" text-anchor=\"middle\" font-weight=\"bold\">" + escaped(title) + "</text>\n";
  const View view = widest_view(after);
  Panel(out, before, view, 0).draw("before", "p0");
  Panel(out, after, view, kPanel).draw("after", "p1");
  return out + "</svg>\n";
}

}  // namespace oriel
