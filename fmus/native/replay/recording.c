#include "recording.h"

#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "resources.h"

static const char LIST[] = "signals/signals.txt";
static const char FORMAT[] = "vibroimpact signals 2";

/* Longest line of the list, longest name of a channel, longest name of a file, each with its end. */
enum { LINE_LENGTH = 160, NAME_LENGTH = 101, FILE_LENGTH = NAME_LENGTH + 32 };

/* Most numbers of all files together. */
enum { MOST_NUMBERS = 100000000 };

/* State of reading a recording: its folder, the message for complaints, the room for further numbers. */
typedef struct {
    const char *folder;
    char *message;
    vi_recording *recording;
    int64_t room;
} vi_reader;

/* ---- files of numbers ---- */

/* Bring little-endian numbers to the byte order of this machine. */
static void to_own_order(double numbers[], int64_t count)
{
    const uint16_t probe = 1;
    unsigned char low;
    memcpy(&low, &probe, 1);
    if (low == 1) {
        return;
    }
    for (int64_t i = 0; i < count; ++i) {
        unsigned char bytes[sizeof(double)], turned[sizeof(double)];
        memcpy(bytes, &numbers[i], sizeof bytes);
        for (size_t k = 0; k < sizeof bytes; ++k) {
            turned[k] = bytes[sizeof bytes - 1 - k];
        }
        memcpy(&numbers[i], turned, sizeof turned);
    }
}

/* Does a file have the length of `count` numbers? Checked before memory is allocated for them. */
static bool has_length(FILE *file, int64_t count)
{
    const bool good = fseek(file, 0, SEEK_END) == 0 && ftell(file) == (long)(count * (int64_t)sizeof(double));
    return fseek(file, 0, SEEK_SET) == 0 && good;
}

/* Read a file that holds `count` little-endian float64 and nothing else; NULL after a complaint. */
static double *read_numbers(vi_reader *reader, const char *name, int64_t count)
{
    if (count > reader->room) {
        vi_complain(reader->message, "resources/%s: expected at most %d numbers in all files, got more", name,
                    MOST_NUMBERS);
        return NULL;
    }
    reader->room -= count;
    FILE *file = vi_resource_open(reader->folder, name);
    if (file == NULL || !has_length(file, count)) {
        vi_complain(reader->message,
                    "resources/%s: expected %" PRId64 " bytes, %" PRId64 " little-endian float64, got %s", name,
                    count * (int64_t)sizeof(double), count, file == NULL ? "no file" : "another size");
        if (file != NULL) {
            (void)fclose(file);
        }
        return NULL;
    }
    double *numbers = malloc((size_t)count * sizeof(double));
    if (numbers == NULL || fread(numbers, sizeof(double), (size_t)count, file) != (size_t)count) {
        vi_complain(reader->message, "resources/%s: expected room in memory and a file that can be read, got none",
                    name);
        free(numbers);
        numbers = NULL;
    } else {
        to_own_order(numbers, count);
    }
    (void)fclose(file);
    return numbers;
}

/* ---- axes ---- */

static bool ascends(const double times[], int64_t count)
{
    for (int64_t i = 1; i < count; ++i) {
        if (!(times[i] > times[i - 1])) {
            return false;
        }
    }
    return isfinite(times[0]) && isfinite(times[count - 1]);
}

/* Add an axis: the file of an even axis holds start and interval, the file of another axis all instants. */
static bool add_axis(vi_reader *reader, bool even, int64_t count)
{
    vi_axis *axis = &reader->recording->axes[reader->recording->axis_count];
    char name[FILE_LENGTH];
    (void)snprintf(name, sizeof name, "signals/axis_%d.f64", reader->recording->axis_count + 1);
    double *numbers = read_numbers(reader, name, even ? 2 : count);
    if (numbers == NULL) {
        return false;
    }
    reader->recording->axis_count += 1;
    axis->count = count;
    if (!even) {
        axis->times = numbers;
        if (!ascends(numbers, count)) {
            vi_complain(reader->message, "resources/%s: expected finite times that ascend strictly, got others", name);
            return false;
        }
        return true;
    }
    axis->start = numbers[0];
    axis->interval = numbers[1];
    free(numbers);
    if (!isfinite(axis->start) || !(axis->interval > 0.0) || !isfinite(axis->start + axis->interval * (double)count)) {
        vi_complain(reader->message, "resources/%s: expected a finite start and an interval > 0 s, got %.17g, %.17g",
                    name, axis->start, axis->interval);
        return false;
    }
    return true;
}

/* ---- channels ---- */

/* Count the gaps, and write them if `gaps` is given. */
static int64_t find_gaps(const double values[], int64_t count, vi_gap *gaps)
{
    int64_t found = 0;
    for (int64_t i = 0; i < count; ++i) {
        if (!isnan(values[i])) {
            continue;
        }
        const int64_t first = i;
        while (i + 1 < count && isnan(values[i + 1])) {
            i += 1;
        }
        if (gaps != NULL) {
            gaps[found] = (vi_gap){first, i};
        }
        found += 1;
    }
    return found;
}

static bool values_are_good(const double values[], int64_t count)
{
    bool any = false;
    for (int64_t i = 0; i < count; ++i) {
        if (isinf(values[i])) {
            return false;
        }
        any = any || !isnan(values[i]);
    }
    return any;
}

static bool add_channel(vi_reader *reader, const char *channel, int axis)
{
    vi_signal *signal = &reader->recording->signals[reader->recording->signal_count];
    const int64_t count = reader->recording->axes[axis].count;
    char name[FILE_LENGTH];
    (void)snprintf(name, sizeof name, "signals/channel_%s.f64", channel);
    signal->values = read_numbers(reader, name, count);
    if (signal->values == NULL) {
        return false;
    }
    reader->recording->signal_count += 1;
    signal->axis = axis;
    if (!values_are_good(signal->values, count)) {
        vi_complain(reader->message,
                    "resources/%s: expected finite numbers, NaN in gaps only, got infinity or no number at all", name);
        return false;
    }
    signal->gap_count = find_gaps(signal->values, count, NULL);
    if (signal->gap_count > 0) {
        signal->gaps = malloc((size_t)signal->gap_count * sizeof(vi_gap));
        if (signal->gaps == NULL) {
            vi_complain(reader->message, "resources/%s: out of memory", name);
            return false;
        }
        (void)find_gaps(signal->values, count, signal->gaps);
    }
    return true;
}

/* ---- the list ---- */

/* Is this a valid name? Its characters cannot lead to another folder. */
static bool is_name(const char *text)
{
    static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz";
    static const char others[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_";
    return text[0] != '\0' && strchr(letters, text[0]) != NULL && text[strspn(text, others)] == '\0';
}

static bool has_room(const vi_reader *reader, int used, int number)
{
    if (used < VI_REPLAY_CHANNELS) {
        return true;
    }
    vi_complain(reader->message, "resources/%s: line %d: expected at most %d of these, got more", LIST, number,
                VI_REPLAY_CHANNELS);
    return false;
}

/* `axis even 600`, `axis listed 600` or `channel NAME AXIS`. */
static bool read_line(vi_reader *reader, const char *line, int number)
{
    char word[8] = "", name[NAME_LENGTH] = "";
    int64_t count = 0;
    int used = 0;
    /* the widths are those of the buffers, and of a number that fits */
    const int fields = sscanf(line, "%7s %100s %9" SCNd64 " %n", word, name, &count, &used);
    const bool whole = fields == 3 && line[used] == '\0';
    const bool even = strcmp(name, "even") == 0;
    if (whole && strcmp(word, "axis") == 0 && (even || strcmp(name, "listed") == 0) && count >= 2) {
        return has_room(reader, reader->recording->axis_count, number) && add_axis(reader, even, count);
    }
    if (whole && strcmp(word, "channel") == 0 && is_name(name) && count >= 1
        && count <= reader->recording->axis_count) {
        return has_room(reader, reader->recording->signal_count, number) && add_channel(reader, name, (int)count - 1);
    }
    vi_complain(reader->message,
                "resources/%s: line %d: expected `axis even COUNT` or `axis listed COUNT` with 2"
                " samples or more, or `channel NAME AXIS` with the number of an axis above, got another",
                LIST, number);
    return false;
}

static bool read_list(vi_reader *reader, FILE *list)
{
    char line[LINE_LENGTH];
    for (int number = 1; fgets(line, sizeof line, list) != NULL; ++number) {
        line[strcspn(line, "\r\n")] = '\0';
        if (number == 1) {
            if (strcmp(line, FORMAT) != 0) {
                vi_complain(reader->message, "resources/%s: line 1: expected `%s`, got another", LIST, FORMAT);
                return false;
            }
        } else if (!read_line(reader, line, number)) {
            return false;
        }
    }
    if (reader->recording->signal_count == 0) {
        vi_complain(reader->message, "resources/%s: expected at least one channel, got none", LIST);
        return false;
    }
    return true;
}

vi_recording *vi_recording_open(const char *folder, char message[VI_MESSAGE_LENGTH])
{
    vi_reader reader = {folder, message, calloc(1, sizeof(vi_recording)), MOST_NUMBERS};
    if (reader.recording == NULL) {
        vi_complain(message, "out of memory");
        return NULL;
    }
    FILE *list = vi_resource_open(folder, LIST);
    if (list == NULL) {
        return reader.recording;
    }
    const bool good = read_list(&reader, list);
    (void)fclose(list);
    if (!good) {
        vi_recording_close(reader.recording);
        return NULL;
    }
    return reader.recording;
}

void vi_recording_close(vi_recording *recording)
{
    if (recording == NULL) {
        return;
    }
    for (int i = 0; i < VI_REPLAY_CHANNELS; ++i) {
        free(recording->axes[i].times);
        free(recording->signals[i].values);
        free(recording->signals[i].gaps);
    }
    free(recording);
}
