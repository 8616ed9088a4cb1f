#include "structure_file.h"

#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "resources.h"

static const char NAME[] = "structure.bin";
static const char MAGIC[] = "VISTRUC2";

/* Bytes of the letters, of a number, of all before the arrays, of the largest file. */
enum { LETTERS = 8, NUMBER = 8, HEAD = LETTERS + 6 * NUMBER, MOST_BYTES = HEAD + VI_MOST_NUMBERS * NUMBER };

/* The bits of a number, on a machine of any byte order. */
static uint64_t bits_at(const unsigned char bytes[])
{
    uint64_t bits = 0;
    for (int k = NUMBER - 1; k >= 0; --k) {
        bits = bits << 8 | bytes[k];
    }
    return bits;
}

/* A whole number from least to most; false after a complaint. */
static bool read_size(const unsigned char bytes[], const char *what, int least, int most, int32_t *size,
                      char message[VI_MESSAGE_LENGTH])
{
    const uint64_t bits = bits_at(bytes);
    if (bits < (uint64_t)least || bits > (uint64_t)most) {
        vi_complain(message, "resources/%s: expected %d to %d %s, got %" PRId64, NAME, least, most, what, (int64_t)bits);
        return false;
    }
    *size = (int32_t)bits;
    return true;
}

static bool read_numbers(const unsigned char bytes[], int count, vi_structure_file *file,
                         char message[VI_MESSAGE_LENGTH])
{
    for (int i = 0; i < count; ++i) {
        const uint64_t bits = bits_at(bytes + (size_t)i * NUMBER);
        memcpy(&file->numbers[i], &bits, sizeof bits);
        if (!isfinite(file->numbers[i])) {
            vi_complain(message, "resources/%s: expected finite numbers, got %g as number %d", NAME, file->numbers[i],
                        i + 1);
            return false;
        }
    }
    return true;
}

static bool read_content(const unsigned char bytes[], size_t length, vi_structure_file *file,
                         char message[VI_MESSAGE_LENGTH])
{
    if (length < HEAD || memcmp(bytes, MAGIC, LETTERS) != 0) {
        vi_complain(message, "resources/%s: expected a file that begins with %s and six sizes, got another", NAME,
                    MAGIC);
        return false;
    }
    const unsigned char *sizes = bytes + LETTERS;
    if (!read_size(sizes, "modes", 1, VI_MODES, &file->modes, message)
        || !read_size(sizes + NUMBER, "contacts", 0, VI_PORTS, &file->contacts, message)
        || !read_size(sizes + 2 * NUMBER, "sines", 0, VI_SINES, &file->sines, message)
        || !read_size(sizes + 3 * NUMBER, "signals", 0, VI_SIGNALS, &file->signals, message)
        || !read_size(sizes + 4 * NUMBER, "rows of tables", 0, VI_TABLE_ROOM, &file->rows, message)
        || !read_size(sizes + 5 * NUMBER, "as mark of coupled damping", 0, 1, &file->coupled, message)) {
        return false;
    }
    const int of_modes = VI_STRUCTURE_ROWS + file->modes + file->contacts + file->sines + file->signals;
    const int count = file->modes * of_modes + 2 * file->rows;
    const size_t expected = HEAD + (size_t)count * NUMBER;
    if (length != expected) {
        vi_complain(message, "resources/%s: expected %zu bytes for %d modes, %d contacts, %d sines, %d signals and %d rows"
                             " of tables, got %s", NAME, expected, (int)file->modes, (int)file->contacts,
                    (int)file->sines, (int)file->signals, (int)file->rows, length < expected ? "fewer" : "more");
        return false;
    }
    return read_numbers(bytes + HEAD, count, file, message);
}

vi_structure_file *vi_structure_file_open(const char *folder, char message[VI_MESSAGE_LENGTH])
{
    vi_structure_file *file = calloc(1, sizeof *file);
    unsigned char *bytes = malloc(MOST_BYTES + 1); /* one more, which tells of a file that is too long */
    FILE *source = vi_resource_open(folder, NAME);
    bool good = file != NULL && bytes != NULL;
    if (!good) {
        vi_complain(message, "resources/%s: out of memory", NAME);
    } else if (source != NULL) {
        good = read_content(bytes, fread(bytes, 1, MOST_BYTES + 1, source), file, message);
    }
    if (source != NULL) {
        (void)fclose(source);
    }
    free(bytes);
    if (!good) {
        free(file);
        return NULL;
    }
    return file;
}
