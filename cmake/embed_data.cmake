# Writes ${OUT}: a function that returns the text of each of ${FILES} by name.
file(WRITE ${OUT}.tmp "// Generated from model/data by cmake/embed_data.cmake.
#include \"model/embedded_data.h\"
namespace sweepfit {
std::string_view EmbeddedData(std::string_view name) {
")
foreach(file ${FILES})
  get_filename_component(name ${file} NAME)
  file(READ ${file} text)
  # String literals are limited to 64 KiB; split at 8000 characters.
  string(LENGTH "${text}" length)
  set(literal "")
  set(at 0)
  while(at LESS length)
    string(SUBSTRING "${text}" ${at} 8000 part)
    string(APPEND literal "R\"__data__(${part})__data__\"\n")
    math(EXPR at "${at} + 8000")
  endwhile()
  file(APPEND ${OUT}.tmp "  if (name == \"${name}\") return ${literal};\n")
endforeach()
file(APPEND ${OUT}.tmp "  return {};
}
}  // namespace sweepfit
")
file(RENAME ${OUT}.tmp ${OUT})
