// gnuplot as a child process. It reads its program from an anonymous file and leaves its picture in another, so it
// meets neither a shell nor a path, can't block on a full pipe, and leaves nothing behind when it is killed.
#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <system_error>

#include "models/error.h"
#include "reference/output_file.h"
#include "report/figure.h"

extern char** environ;

namespace lobefit {

namespace {

/// A file in memory, without a name.
class AnonymousFile {
 public:
  explicit AnonymousFile(const char* purpose) : descriptor_(memfd_create(purpose, MFD_CLOEXEC)) {
    if (descriptor_ < 0) fail();
  }
  ~AnonymousFile() { close(descriptor_); }
  AnonymousFile(const AnonymousFile&) = delete;
  AnonymousFile& operator=(const AnonymousFile&) = delete;

  int descriptor() const { return descriptor_; }

  void write(std::string_view content) {
    for (std::size_t done = 0; done < content.size();) {
      const ssize_t count = pwrite(descriptor_, content.data() + done, content.size() - done, static_cast<off_t>(done));
      if (count < 0 && errno != EINTR) fail();
      if (count > 0) done += static_cast<std::size_t>(count);
    }
  }

  std::string read() const {
    std::string content;
    std::array<char, 1 << 16> buffer;
    while (true) {
      const ssize_t count = pread(descriptor_, buffer.data(), buffer.size(), static_cast<off_t>(content.size()));
      if (count < 0 && errno != EINTR) fail();
      if (count == 0) return content;
      if (count > 0) content.append(buffer.data(), static_cast<std::size_t>(count));
    }
  }

 private:
  [[noreturn]] static void fail() {
    throw Error(ExitCode::failure, std::string("can't talk to gnuplot: ") + std::strerror(errno), "",
                "check the free memory");
  }

  int descriptor_;
};

struct Outcome {
  int wait_status;
  std::string picture, messages;
};

Outcome run_gnuplot(const std::string& terminal, const std::string& program) {
  AnonymousFile input("gnuplot program"), output("gnuplot picture"), messages("gnuplot messages");
  input.write(program);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input.descriptor(), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output.descriptor(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, messages.descriptor(), STDERR_FILENO);
  // In a process group of its own gnuplot does not see the terminal's Ctrl-C: whether to stop is decided here.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);

  // --default-settings: without the user's own start-up files, which could change the picture.
  std::array<std::string, 5> arguments{"gnuplot", "--default-settings", "-e", terminal, "-"};
  std::array<char*, 6> argument_pointers{};
  for (std::size_t i = 0; i < arguments.size(); ++i) argument_pointers[i] = arguments[i].data();
  pid_t child = 0;
  const int fault = posix_spawnp(&child, "gnuplot", &actions, &attributes, argument_pointers.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (fault == ENOENT || fault == ENOTDIR || fault == EACCES) {
    throw Error(ExitCode::missing_part, "figures need gnuplot, which is not installed", "PATH",
                "install Debian's package gnuplot-nox");
  }
  if (fault != 0) {
    throw Error(ExitCode::failure, std::string("can't start gnuplot: ") + std::strerror(fault), "",
                "check the limits on processes and memory");
  }

  Outcome outcome{};
  while (waitpid(child, &outcome.wait_status, 0) < 0) {
    if (errno != EINTR) throw std::system_error(errno, std::generic_category(), "waiting for gnuplot");
  }
  outcome.picture = output.read();
  outcome.messages = messages.read();
  return outcome;
}

/// What gnuplot says first. It quotes the faulty command above its message, which starts with the place: `line 3: …`.
std::string first_message(std::string_view messages) {
  std::string first;
  while (!messages.empty()) {
    const std::size_t end = std::min(messages.find('\n'), messages.size() - 1);
    std::string_view line = messages.substr(0, end + 1);
    messages.remove_prefix(end + 1);
    constexpr std::string_view blank = " \t\r\n";
    line.remove_prefix(std::min(line.find_first_not_of(blank), line.size()));
    line = line.substr(0, line.find_last_not_of(blank) + 1);
    if (first.empty()) first = line;
    if (line.starts_with("line ")) {
      // Lines read from a pipe are not counted: the number is always 0.
      const std::size_t colon = line.find(": ");
      return std::string(colon == std::string_view::npos ? line : line.substr(colon + 2));
    }
  }
  return first.empty() ? "no message" : first;
}

/// gnuplot names fonts as fontconfig does, SVG as CSS does. Whoever looks at the SVG may not have DejaVu Sans; Verdana,
/// from which it descends, has nearly its widths.
std::string with_css_fonts(const std::string& svg) {
  constexpr std::string_view attribute = "font-family=\"DejaVu Sans", bold = ":Bold";
  std::string result;
  std::size_t done = 0;
  for (std::size_t found; (found = svg.find(attribute, done)) != std::string::npos;) {
    const std::size_t end = found + attribute.size();
    const bool is_bold = svg.compare(end, bold.size(), bold) == 0;
    result.append(svg, done, found - done);
    result += is_bold ? "font-weight=\"bold\" " : "";
    result += attribute;
    result += ", Verdana, sans-serif";
    done = end + (is_bold ? bold.size() : 0);
  }
  return result.append(svg, done);
}

}  // namespace

void write_figure(const std::string& gnuplot_program, const std::filesystem::path& path, bool overwrite,
                  FigureSize size) {
  const bool is_svg = path.extension() == ".svg";
  if (!is_svg && path.extension() != ".png") {
    throw Error(ExitCode::usage, "unknown kind of picture '" + path.extension().string() + "'", path.string(),
                "name a file that ends in .svg or .png");
  }
  constexpr int smallest = 200, largest = 16384;
  if (std::min(size.width, size.height) < smallest || std::max(size.width, size.height) > largest) {
    throw Error(ExitCode::usage, fmt::format("a figure of {} × {} pixels", size.width, size.height), path.string(),
                fmt::format("choose {} to {} each way", smallest, largest));
  }
  // Programs give font sizes in pixels; pngcairo takes them as points of 96 dpi, and draws smaller points than svg.
  const std::string terminal = fmt::format(
      "figure_width = {0}; figure_height = {1}; set terminal {2} size {0},{1} enhanced font 'DejaVu Sans,12' "
      "background '#ffffff'{3}",
      size.width, size.height, is_svg ? "svg" : "pngcairo", is_svg ? "" : " fontscale 0.75 pointscale 1.3");
  const Outcome outcome = run_gnuplot(terminal, gnuplot_program);
  if (WIFSIGNALED(outcome.wait_status)) {
    const int number = WTERMSIG(outcome.wait_status);
    throw Error(ExitCode::failure, fmt::format("gnuplot was killed by signal {} ({})", number, strsignal(number)),
                path.string(), "check the free memory and try again");
  }
  // Our programs' own complaint.
  if (WEXITSTATUS(outcome.wait_status) == 2) {
    throw Error(ExitCode::usage, first_message(outcome.messages),
                fmt::format("{} × {} pixels", size.width, size.height), "choose a larger one, or fewer panels");
  }
  if (WEXITSTATUS(outcome.wait_status) != 0 || outcome.picture.empty()) {
    throw Error(ExitCode::failure, "gnuplot failed: " + first_message(outcome.messages), path.string(),
                "the program is lobefit's own: please report this");
  }
  // Opened only now: a signal while gnuplot works finds no file to leave behind.
  OutputFile file(path, overwrite);
  file.write(is_svg ? with_css_fonts(outcome.picture) : outcome.picture);
  file.commit();
}

}  // namespace lobefit
