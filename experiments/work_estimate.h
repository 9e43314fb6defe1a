// How long the rest of an experiment takes, from what each kind of work has cost so far.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace ambilux {

/// Work of one render: it ends when it has both that many samples (of all pixels together) and that much time.
struct Work {
    double samples = 0, seconds = 0;
};

/// Estimates, not promises: a sample of a kind is taken to cost what those of this kind have cost so far, or those of
/// all kinds where none was made yet. Loading, metrics and writing of files are not in it.
class WorkEstimate {
public:
    /// `count` more renders of this kind. All renders of one kind ask for the same work.
    void plan(const std::string& kind, double count, Work each);
    /// A render of this kind begins or is continued: so much of it is left.
    void begin(const std::string& kind, Work left);
    /// Work on the render that began.
    void progress(const std::string& kind, double samples, double seconds);
    /// The render that began is complete.
    void end(const std::string& kind);
    /// A render that need not be made.
    void skip(const std::string& kind);
    /// What samples cost, measured elsewhere.
    void measured(const std::string& kind, double samples, double seconds);

    double seconds_done() const { return done_; }
    /// Infinite while nothing is known.
    double seconds_left() const;
    double seconds_left(const std::string& kind) const;
    double fraction() const;

private:
    struct Kind {
        double renders = 0;               ///< not begun
        Work each, left;                  ///< of one that is not begun; of the one that is
        double samples = 0, seconds = 0;  ///< measured
    };
    double seconds_of(const Kind& kind, const Work& work) const;

    std::map<std::string, Kind> kinds_;
    double samples_ = 0, seconds_ = 0, done_ = 0;
};

}  // namespace ambilux
