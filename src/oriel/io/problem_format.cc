#include "oriel/io/problem_format.h"

#include "oriel/io/problem_text.h"
#include "oriel/io/text.h"

namespace oriel {

Result<ProblemFormat> detect_format(std::string_view text, const std::string& file_name) {
  TextScanner scanner(text);
  if (!scanner.next_line())
    return Error{ErrorCode::bad_input, "expected a g2o or BAL problem, found an empty file", file_name};
  const std::string_view word = scanner.token();
  const char c = word.front();
  if (c >= 'A' && c <= 'Z') return ProblemFormat::g2o;
  if ((c >= '0' && c <= '9') || c == '-' || c == '+') return ProblemFormat::bal;
  return Error{ErrorCode::bad_input, "expected a g2o tag or the three counts of a BAL file, found " + quote_token(word),
               file_name, scanner.line()};
}

Result<ProblemFormat> detect_format(const std::string& path) {
  const Result<ProblemText> text = read_problem_text(path);
  if (!text) return text.error();
  return detect_format(text->view(), path);
}

}  // namespace oriel
