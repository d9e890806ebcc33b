// The right API of apps.py on Go's net/http: server PORT, in the folder of spec.json.
package main

import (
	"encoding/json"
	"io"
	"math"
	"mime"
	"net/http"
	"os"
	"unicode/utf8"
)

func only(allow string, w http.ResponseWriter, r *http.Request) bool {
	if r.Method == allow || (allow == "GET" && r.Method == "HEAD") {
		return true
	}
	if allow == "GET" {
		allow = "GET, HEAD"
	}
	w.Header().Set("Allow", allow)
	w.WriteHeader(405)
	return false
}

func distance(w http.ResponseWriter, r *http.Request) {
	if !only("POST", w, r) {
		return
	}
	kind, _, _ := mime.ParseMediaType(r.Header.Get("Content-Type"))
	if kind != "application/json" {
		w.WriteHeader(415)
		return
	}
	body, _ := io.ReadAll(r.Body)
	var state map[string]any
	err := json.Unmarshal(body, &state)
	x, isNumber := state["x"].(float64)
	if err != nil || !utf8.Valid(body) || !isNumber || len(state) != 1 || math.Abs(x) > 10 {
		w.WriteHeader(400)
		return
	}
	answer, _ := json.Marshal(map[string]float64{"x": math.Abs(x)})
	w.Header().Set("Content-Type", "application/json")
	w.Write(answer)
}

func main() {
	spec, _ := os.ReadFile("spec.json")
	for path, body := range map[string][]byte{"/state": []byte(`{"x":1.5}`), "/openapi.json": spec} {
		body := body
		http.HandleFunc(path, func(w http.ResponseWriter, r *http.Request) {
			if only("GET", w, r) {
				w.Header().Set("Content-Type", "application/json")
				w.Write(body)
			}
		})
	}
	http.HandleFunc("/distance", distance)
	http.ListenAndServe("127.0.0.1:"+os.Args[1], nil)
}
