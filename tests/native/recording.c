/* A recording: damaged files give a message and leak nothing; neighbours of a sample equal those of a plain search. */
#define _POSIX_C_SOURCE 200809L
#include "../../fmus/native/adapters/resources.c"
#include "../../fmus/native/replay/player.c"
#include "../../fmus/native/replay/recording.c"

#include <sys/stat.h>

#include "check.h"

enum { SAMPLES = 40 };

static const char *folder; /* of resources, next to this program */

static void write_file(const char *name, const void *bytes, size_t size)
{
    char path[VI_PATH_LENGTH];
    (void)snprintf(path, sizeof path, "%s/signals/%s", folder, name);
    FILE *file = fopen(path, "wb");
    CHECK(file != NULL && fwrite(bytes, 1, size, file) == size, "%s", path);
    (void)fclose(file);
}

static void write_list(const char *text)
{
    write_file("signals.txt", text, strlen(text));
}

static const char GOOD[] = "vibroimpact signals 2\naxis even 40\naxis listed 40\nchannel a 1\nchannel b 2\n";

/* Write samples, each missing with this probability, but at least one with a value; and instants that ascend. */
static void write_numbers(uint64_t *seed, double missing)
{
    double values[SAMPLES], times[SAMPLES];
    const double even[2] = {uniform(seed, -1.0, 1.0), uniform(seed, 1e-3, 1.0)};
    for (int i = 0; i < SAMPLES; ++i) {
        values[i] = uniform(seed, 0.0, 1.0) < missing ? NAN : uniform(seed, -1.0, 1.0);
        times[i] = (i > 0 ? times[i - 1] : 0.0) + uniform(seed, 1e-3, 1.0);
    }
    values[choice(seed, SAMPLES)] = 0.5;
    write_file("axis_1.f64", even, sizeof even);
    write_file("axis_2.f64", times, sizeof times);
    write_file("channel_a.f64", values, sizeof values);
    write_file("channel_b.f64", values, sizeof values);
}

/* The neighbours, by a search from the sample in both directions. */
static vi_neighbours searched(const vi_signal *signal, int64_t index, int64_t count)
{
    vi_neighbours found = {index, index + 1};
    while (found.left >= 0 && isnan(signal->values[found.left])) {
        found.left -= 1;
    }
    while (found.right < count && isnan(signal->values[found.right])) {
        found.right += 1;
    }
    return found;
}

static void any_gaps_are_bridged_from_the_last_value_to_the_next(uint64_t *seed)
{
    write_list(GOOD);
    for (int trial = 0; trial < 200; ++trial) {
        write_numbers(seed, uniform(seed, 0.0, 1.1));
        char message[VI_MESSAGE_LENGTH] = "";
        vi_recording *recording = vi_recording_open(folder, message);
        CHECK(recording != NULL && message[0] == '\0', "%s", message);
        for (int k = 0; k < recording->signal_count; ++k) {
            const vi_signal *signal = &recording->signals[k];
            const vi_axis *axis = &recording->axes[signal->axis];
            for (int64_t index = 0; index < SAMPLES; ++index) {
                const vi_neighbours found = neighbours(signal, index), expected = searched(signal, index, SAMPLES);
                CHECK(found.left == expected.left && found.right == expected.right, "sample %d", (int)index);
            }
            for (int i = 0; i < 50; ++i) {
                const double begin = instant(axis, 0), end = instant(axis, SAMPLES - 1);
                const vi_place place = vi_axis_place(axis, uniform(seed, begin - 1.0, end + 1.0));
                CHECK(place.index >= 0 && place.index < SAMPLES, "index %d", (int)place.index);
                CHECK(place.index == 0 || place.since >= -SAME_INSTANT, "since %g", place.since);
                const vi_playing now = vi_signal_at(signal, axis, &place);
                CHECK(fabs(now.value) <= 1.001 && isfinite(now.rate), "value %g, rate %g", now.value, now.rate);
                CHECK(!now.valid || !place.outside, "valid outside");
            }
        }
        vi_recording_close(recording);
    }
}

static void a_damaged_list_is_told_or_harmless(uint64_t *seed)
{
    static const char alphabet[] = "\n\r\t 0129-+.ex/\\channelaxisevenlisted\xff\x01%";
    write_numbers(seed, 0.3);
    int refused = 0;
    for (int trial = 0; trial < 1000; ++trial) {
        char text[sizeof GOOD];
        memcpy(text, GOOD, sizeof text);
        for (unsigned i = 0; i <= choice(seed, 4); ++i) {
            text[choice(seed, sizeof text - 1)] = alphabet[choice(seed, sizeof alphabet - 1)];
        }
        write_file("signals.txt", text, choice(seed, 5) == 0 ? choice(seed, sizeof text) : sizeof text - 1);
        char message[VI_MESSAGE_LENGTH] = "";
        vi_recording *recording = vi_recording_open(folder, message);
        refused += recording == NULL;
        CHECK((recording == NULL) == (message[0] != '\0'), "message %s", message);
        vi_recording_close(recording);
    }
    CHECK(refused > 300, "%d refused", refused);
}

static void a_folder_without_a_list_has_no_channel(void)
{
    char message[VI_MESSAGE_LENGTH] = "";
    const char *places[] = {NULL, "/no/such/folder"};
    for (int i = 0; i < 2; ++i) {
        vi_recording *recording = vi_recording_open(places[i], message);
        CHECK(recording != NULL && recording->signal_count == 0 && message[0] == '\0', "%s", message);
        vi_recording_close(recording);
    }
}

int main(int count, char *arguments[])
{
    CHECK(count > 0, "%d", count);
    *strrchr(arguments[0], '/') = '\0';
    folder = arguments[0];
    uint64_t seed = 20;
    char path[VI_PATH_LENGTH];
    (void)snprintf(path, sizeof path, "%s/signals", folder);
    CHECK(mkdir(path, 0700) == 0, "%s", path);
    any_gaps_are_bridged_from_the_last_value_to_the_next(&seed);
    a_damaged_list_is_told_or_harmless(&seed);
    a_folder_without_a_list_has_no_channel();
    return 0;
}
