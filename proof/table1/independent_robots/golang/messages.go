// The messages, with pointers so that what is missing shows; and how input is read into them.
package main

import (
	"encoding/json"
	"errors"
	"fmt"
	"io"
	"net/http"
	"reflect"
	"strings"
	"time"
	"unicode/utf8"
)

const largest = 256 * 1024

type stamp struct {
	Sec     int64 `json:"sec"`
	Nanosec int64 `json:"nanosec"`
}

type vector struct {
	X *float64 `json:"x"`
	Y *float64 `json:"y"`
	Z *float64 `json:"z"`
}

type quaternion struct {
	X *float64 `json:"x"`
	Y *float64 `json:"y"`
	Z *float64 `json:"z"`
	W *float64 `json:"w"`
}

type pose struct {
	Position    *vector     `json:"position"`
	Orientation *quaternion `json:"orientation"`
}

type twist struct {
	Linear  *vector `json:"linear"`
	Angular *vector `json:"angular"`
}

type header struct {
	Stamp   *stamp  `json:"stamp" may:"lack"`
	FrameID *string `json:"frame_id"`
}

type poseStamped struct {
	Header *header `json:"header"`
	Pose   *pose   `json:"pose"`
}

type goalID struct {
	Stamp *stamp  `json:"stamp" may:"lack"`
	ID    *string `json:"id"`
}

type actionGoal struct {
	Header *header `json:"header" may:"lack"`
	GoalID *goalID `json:"goal_id" may:"lack"`
	Goal   *struct {
		TargetPose *poseStamped `json:"target_pose"`
	} `json:"goal"`
}

// An error that becomes an answer.
type refused struct {
	status int
	detail string
}

func (r refused) Error() string { return r.detail }

func refuse(status int, format string, values ...any) error {
	return refused{status, fmt.Sprintf(format, values...)}
}

func stampOf(when time.Time) *stamp { return &stamp{when.Unix(), int64(when.Nanosecond())} }

// Reads JSON into a message.
func readJSON(w http.ResponseWriter, r *http.Request, message any) error {
	kind, parameters, _ := strings.Cut(strings.ToLower(r.Header.Get("Content-Type")), ";")
	parameters = strings.ReplaceAll(strings.TrimSpace(parameters), `"`, "")
	if strings.TrimSpace(kind) != "application/json" || (parameters != "" && parameters != "charset=utf-8") {
		return refuse(415, "Content-Type: %q is not taken", r.Header.Get("Content-Type"))
	}
	octets, err := io.ReadAll(http.MaxBytesReader(w, r.Body, largest))
	if tooLarge := (*http.MaxBytesError)(nil); errors.As(err, &tooLarge) {
		return refuse(413, "more than %d octets", largest)
	}
	if err != nil {
		return err
	}
	if !utf8.Valid(octets) {
		return refuse(400, "no JSON: no UTF-8")
	}
	decoder := json.NewDecoder(strings.NewReader(string(octets)))
	decoder.DisallowUnknownFields()
	if err := decoder.Decode(message); err != nil {
		if wrong := (*json.UnmarshalTypeError)(nil); errors.As(err, &wrong) {
			return refuse(422, "%s: a %s is no %s", wrong.Field, wrong.Value, wrong.Type)
		}
		if strings.HasPrefix(err.Error(), "json: unknown field") {
			return refuse(422, "%s", err)
		}
		return refuse(400, "no JSON: %s", err)
	}
	if _, err := decoder.Token(); err != io.EOF {
		return refuse(400, "no JSON: more behind it")
	}
	return lacks(reflect.ValueOf(message), "")
}

// Names the first field that is missing, or null.
func lacks(value reflect.Value, path string) error {
	if value.Kind() == reflect.Pointer {
		if value.IsNil() {
			return refuse(422, "%s: missing, or null", path)
		}
		return lacks(value.Elem(), path)
	}
	if value.Kind() != reflect.Struct {
		return nil
	}
	for i := 0; i < value.NumField(); i++ {
		field, part := value.Type().Field(i), value.Field(i)
		if field.Tag.Get("may") == "lack" && part.IsNil() {
			continue
		}
		if err := lacks(part, strings.TrimPrefix(path+"."+field.Tag.Get("json"), ".")); err != nil {
			return err
		}
	}
	return nil
}
